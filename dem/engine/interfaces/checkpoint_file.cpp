#include "interfaces/checkpoint_file.h"

#include <fcntl.h>
#include <mpi.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cstdint>
#include <cstdio>
#include <cstring>

#include "comm.h"
#include "error.h"
#include "lammps.h"

namespace LAMMPS_NS {

namespace {

const char MAGIC[9] = "CGISTATE";
const int64_t VERSION = 7;
const size_t NAME = 32;

struct Header {
  char magic[8];
  int64_t version;
  char identity[64];
  int64_t bytes, crc;
};

bool write_all(int out, const char *data, size_t size) {
  while (size) {
    const ssize_t some = write(out, data, size);
    if (some < 0 && errno == EINTR) continue;
    if (some <= 0) return false;
    data += some, size -= some;
  }
  return true;
}

}  // namespace

uint32_t crc_of(const char *bytes, size_t size, uint32_t crc_before) {
  return crc32_z(crc_before, reinterpret_cast<const Bytef *>(bytes), size);
}

void CheckpointWriter::common(const std::string &name, const std::vector<double> &values) {
  char fixed[NAME] = {};
  std::strncpy(fixed, name.c_str(), NAME - 1);
  const int64_t count = values.size();
  blocks_.append(fixed, NAME);
  blocks_.append(reinterpret_cast<const char *>(&count), 8);
  blocks_.append(reinterpret_cast<const char *>(values.data()), 8 * count);
}

void CheckpointWriter::sum(const std::string &name, const std::vector<double> &mine) {
  std::vector<double> total(mine.size());
  MPI_Reduce(mine.data(), total.data(), mine.size(), MPI_DOUBLE, MPI_SUM, 0, lmp_->world);
  common(name, total);
}

void CheckpointWriter::rows(const std::string &name, const std::vector<double> &mine) {
  const int ranks = lmp_->comm->nprocs, size = mine.size();
  std::vector<int> count(ranks), offset(ranks, 0);
  MPI_Gather(&size, 1, MPI_INT, count.data(), 1, MPI_INT, 0, lmp_->world);
  for (int p = 1; p < ranks; p++) offset[p] = offset[p - 1] + count[p - 1];
  std::vector<double> all(lmp_->comm->me == 0 ? offset.back() + count.back() : 0);
  MPI_Gatherv(mine.data(), size, MPI_DOUBLE, all.data(), count.data(), offset.data(), MPI_DOUBLE, 0, lmp_->world);
  common(name, all);
}

void CheckpointWriter::write(const std::string &file, const std::string &identity) {
  if (lmp_->comm->me != 0) return;
  Header header = {};
  std::memcpy(header.magic, MAGIC, 8);
  identity.copy(header.identity, sizeof header.identity);
  header.version = VERSION;
  header.bytes = blocks_.size();
  header.crc = crc_of(blocks_.data(), blocks_.size());
  const std::string beside = file + ".part";
  const int out = open(beside.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
  const bool written = out >= 0 && write_all(out, reinterpret_cast<const char *>(&header), sizeof header) &&
                       write_all(out, blocks_.data(), blocks_.size()) && fsync(out) == 0;
  const int cause = errno;
  if (out >= 0) close(out);
  if (!written || std::rename(beside.c_str(), file.c_str()) != 0) {
    const std::string why = std::strerror(written ? errno : cause);
    unlink(beside.c_str());
    lmp_->error->one(FLERR, ("cannot write " + file + ": " + why).c_str());
  }
}

CheckpointReader::CheckpointReader(LAMMPS *lmp, const std::string &file) : lmp_(lmp), file_(file) {
  Header header;
  std::string data;
  if (lmp->comm->me == 0) {
    FILE *in = std::fopen(file.c_str(), "rb");
    if (!in) fail(std::strerror(errno));
    if (std::fread(&header, sizeof header, 1, in) != 1 || std::memcmp(header.magic, MAGIC, 8) != 0)
      fail("not a checkpoint of the engine");
    if (header.version != VERSION) fail("a checkpoint of another version of the engine");
    data.resize(header.bytes);
    const size_t got = std::fread(&data[0], 1, data.size(), in);
    std::fclose(in);
    if (got != data.size() || crc_of(data.data(), data.size()) != header.crc) fail("cut off or damaged");
  }
  MPI_Bcast(&header, sizeof header, MPI_BYTE, 0, lmp->world);
  data.resize(header.bytes);
  for (int64_t start = 0; start < header.bytes; start += INT_MAX)
    MPI_Bcast(&data[start], std::min<int64_t>(INT_MAX, header.bytes - start), MPI_BYTE, 0, lmp->world);
  for (size_t at = 0; at + NAME + 8 <= data.size();) {
    const std::string name = &data[at];
    int64_t count;
    std::memcpy(&count, &data[at + NAME], 8);
    std::vector<double> &values = blocks_[name];
    values.resize(count);
    std::copy_n(&data[at + NAME + 8], 8 * count, reinterpret_cast<char *>(values.data()));  // of none, too
    at += NAME + 8 + 8 * count;
  }
}

const std::vector<double> &CheckpointReader::block(const std::string &name) const {
  const auto found = blocks_.find(name);
  if (found == blocks_.end()) fail("has no " + name);
  return found->second;
}

const std::vector<double> &CheckpointReader::common(const std::string &name, size_t count) const {
  const std::vector<double> &values = block(name);
  if (values.size() != count) fail("is of another deck: " + name);
  return values;
}

std::vector<double> CheckpointReader::sum(const std::string &name, size_t count) const {
  const std::vector<double> &values = common(name, count);
  return lmp_->comm->me == 0 ? values : std::vector<double>(count, 0.0);
}

const std::vector<double> &CheckpointReader::rows(const std::string &name, size_t columns) const {
  const std::vector<double> &values = block(name);
  if (values.size() % columns != 0) fail("is of another deck: " + name);
  return values;
}

void CheckpointReader::fail(const std::string &what) const {
  lmp_->error->one(FLERR, (file_ + ": " + what).c_str());
  std::abort();  // not reached: error->one does not return
}

}  // namespace LAMMPS_NS
