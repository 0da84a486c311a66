#pragma once
#include <cstdio>
#include <string>
#include <vector>

#include "agglomerates.h"
#include "plate_contact.h"

namespace LAMMPS_NS {

class CheckpointReader;
class CheckpointWriter;
class LAMMPS;

// Writes what the stones do to the plate, in two files of 8-byte numbers to which rank 0 appends:
//
//   forces:    int64 step, double force_N[agglomerates]: the mean push on the plate over the co-step that ends at this
//              step. Nothing is written for a co-step without contact.
//   contacts:  int64 step, int64 n, then n rows of doubles, one for each contact at this step: agglomerate (from 1),
//              x, y (m), elastic normal force (N), and the radius (m) of the sphere that presses, which is that of the
//              flattened contact where the plate has yielded. There is such a file only where it is named.
//
// All ranks call its functions together.
class ContactRecorder {
 public:
  ContactRecorder(LAMMPS *, const Agglomerates &, const std::string &forces_file, const std::string &contacts_file);
  ~ContactRecorder();

  void add_forces(const std::vector<NearSphere> &, double share);  // of the mean over this co-step
  void end_co_step();
  // Of this step: the rows that the file of contacts has, all of them on rank 0.
  std::vector<double> contacts(const std::vector<NearSphere> &, const PlateContact &) const;
  void record_contacts(const std::vector<NearSphere> &, const PlateContact &);
  void flush();

  void save(CheckpointWriter &);
  void restore(const CheckpointReader &);

 private:
  LAMMPS *lmp_;
  const Agglomerates &agglomerates_;
  std::vector<double> push_;  // so far in this co-step, by agglomerate, N
  bool has_contacts_;
  FILE *forces_ = nullptr, *contacts_ = nullptr;

  FILE *opened(const std::string &file) const;
  void write(const std::vector<double> &contacts) const;
};

}  // namespace LAMMPS_NS
