#pragma once
#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include "interfaces/agglomerates.h"
#include "contact/plate_contact.h"

namespace LAMMPS_NS {

class CheckpointReader;
class CheckpointWriter;
class LAMMPS;

// Writes what the stones do to the plate, in two files of 8-byte numbers to which rank 0 appends:
//
//   forces:    int64 step, int64 agglomerate (from 1), double mean_N, largest_N, x_m, y_m: a row for each agglomerate
//              that pushed in the time of so many steps that ends at this step. The mean and the largest are those of
//              the mean pushes over co-steps, the place that of the push's middle. Before them a row of agglomerate 0
//              has the mean and the largest of all together.
//   contacts:  int64 step, int64 n, then n rows of doubles, one for each contact at this step: agglomerate (from 1),
//              x, y (m), elastic normal force (N), and the radius (m) of the sphere that presses, which is that of the
//              flattened contact where the plate has yielded. There is such a file only where it is named.
//
// All ranks call its functions together.
class ContactRecorder {
 public:
  // A row of the file of forces covers `row_steps` steps, a whole number of co-steps.
  ContactRecorder(LAMMPS *, const Agglomerates &, const std::string &forces_file, const std::string &contacts_file,
                  int co_step, int row_steps);
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
  struct Push {
    double force = 0, x = 0, y = 0;  // N; force x place, N m
  };
  struct Row {
    double mean = 0, largest = 0, weight = 0, x = 0, y = 0;  // of the time covered; weight is that of the places
  };

  LAMMPS *lmp_;
  const Agglomerates &agglomerates_;
  std::vector<Push> push_;       // so far in this co-step, by agglomerate
  std::map<int, Row> row_;       // of those that pushed in this time, all of them under -1; on rank 0
  long long row_end_ = 0;        // step
  int co_step_, row_steps_;
  bool has_contacts_;
  FILE *forces_ = nullptr, *contacts_ = nullptr;

  FILE *opened(const std::string &file) const;
  void write(const std::vector<double> &contacts) const;
  void add(int agglomerate, const Push &);
  void write_row();
};

}  // namespace LAMMPS_NS
