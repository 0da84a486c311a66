#pragma once
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace LAMMPS_NS {

class LAMMPS;

// State of the engine as named blocks of numbers in one file:
//
//   char magic[8], int64 version, char identity[64] of the run, int64 bytes of what follows the CRC, int64 CRC-32 of it
//     (that of zlib)
//   then each block: char name[32], int64 count, double[count]
//
// The first block is "streams": of each stream, which is a file that the run appends to, the length and the CRC-32 of
// what it held then. dem/run/directory.py checks all of these before a run is resumed.
uint32_t crc_of(const char *bytes, size_t size, uint32_t crc_before = 0);

class CheckpointWriter {
 public:
  explicit CheckpointWriter(LAMMPS *lmp) : lmp_(lmp) {}
  // All ranks call these together.
  void common(const std::string &name, const std::vector<double> &values);  // the same on all ranks
  void sum(const std::string &name, const std::vector<double> &mine);       // over the ranks
  void rows(const std::string &name, const std::vector<double> &mine);      // of all ranks, one after the other
  void append(const CheckpointWriter &other) { blocks_ += other.blocks_; }
  // Writes another file first and renames it, so that `file` is whole or as it was before.
  void write(const std::string &file, const std::string &identity);

 private:
  LAMMPS *lmp_;
  std::string blocks_;
};

class CheckpointReader {
 public:
  CheckpointReader(LAMMPS *lmp, const std::string &file);
  // An error ends the run where a block is missing, or has not `count` numbers, or not whole rows of `columns`.
  const std::vector<double> &common(const std::string &name, size_t count) const;
  std::vector<double> sum(const std::string &name, size_t count) const;  // all of it on rank 0, nothing elsewhere
  const std::vector<double> &rows(const std::string &name, size_t columns) const;

 private:
  LAMMPS *lmp_;
  std::string file_;
  std::map<std::string, std::vector<double>> blocks_;

  const std::vector<double> &block(const std::string &name) const;
  [[noreturn]] void fail(const std::string &what) const;
};

}  // namespace LAMMPS_NS
