#include "contact/face_columns.h"

#include <algorithm>
#include <cmath>
#include <fstream>

#include "atom.h"
#include "error.h"
#include "base/fixes.h"
#include "lammps.h"
#include "base/rigid_motion.h"
#include "interfaces/stone_stream.h"
#include "update.h"

namespace LAMMPS_NS {

namespace {
const int FACE_COLUMNS = 3;    // of the memory
const double ALONE = -1;       // the sub-sphere itself presses
const double PARALLEL_rad = 0.005;  // a face turned further from the plate's meets it with an edge or a corner
const double SUDDEN = 2;       // steps: what is deeper than it came in so many begins without force
}  // namespace

FaceColumns::FaceColumns(LAMMPS *lmp, const std::string &file, int tags)
    : lmp_(lmp), atom_(lmp->atom), columns_(tags + 1), memory_(lmp, FACE_COLUMNS, "wall/plate:faces") {
  std::ifstream in(file);
  auto refuse = [&] { lmp->error->all(FLERR, ("Cannot read the faces of the stones from " + file).c_str()); };
  std::string word;
  if (!(in >> outside_)) refuse();
  const auto faces = in.tellg();
  if (in >> word && word == "stream") return;
  in.clear();
  in.seekg(faces);
  for (double row[EnteringStone::FACE_COLUMNS]; in >> row[0];) {
    for (int k = 1; k < EnteringStone::FACE_COLUMNS; k++) in >> row[k];
    if (!in || row[0] < 1 || row[0] > tags || !(std::min({norm(Vec(row + 1)), row[4], row[5], row[6]}) > 0)) refuse();
    put(row);
  }
  if (!in.eof()) refuse();
}

void FaceColumns::put(const double *row) {
  columns_[static_cast<int>(row[0])].push_back({Vec(row + 1), row[4], row[5], row[6]});
}

void FaceColumns::setup() {
  bonds_ = fix_that_is<BondNetwork>(lmp_->modify);
  if (!bonds_) lmp_->error->all(FLERR, "The contact of faces needs fix bond/parallel");
}

void FaceColumns::enter(const EnteringStone &stone) {
  for (size_t k = 0; k < stone.faces.size(); k += EnteringStone::FACE_COLUMNS) put(&stone.faces[k]);
}

void FaceColumns::leave(int first_tag, int count) {
  for (int tag = first_tag; tag < first_tag + count; tag++) columns_[tag].clear();
}

FacePress FaceColumns::press(int i, double distance, double speed, bool is_over_plate) {
  const int tag = atom_->tag[i];
  if (columns_[tag].empty()) return {};
  double &state = memory_.row(i)[0], &offset = memory_.row(i)[1], &force = memory_.row(i)[2];
  const double way = std::fabs(speed) * lmp_->update->dt;
  if (state == ALONE && distance < atom_->radius[i]) return {};
  if (state > 0) {
    const double depth = columns_[tag][static_cast<int>(state) - 1].height - distance;
    offset = std::max(0.0, std::min(offset, depth));
    if (depth > 0) return now(i, distance, way);
  }
  FacePress free;
  free.force_before = force;
  state = offset = force = 0;
  const int face = is_over_plate && distance < atom_->radius[i] + outside_ ? column_beneath(i) : -1;
  if (face >= 0 && distance < columns_[tag][face].height && has_its_bonds(tag)) {
    const double depth = columns_[tag][face].height - distance;
    state = face + 1;
    offset = depth > SUDDEN * way ? depth : 0;
    return now(i, distance, way);
  }
  if (distance < atom_->radius[i]) state = ALONE;
  return free;
}

FacePress FaceColumns::now(int i, double distance, double way) {
  double *row = memory_.row(i);
  const FaceColumn &c = columns_[atom_->tag[i]][static_cast<int>(row[0]) - 1];
  const FacePress press{true, c.height - distance - row[1], c.stiffness, c.area, way, row[2]};
  row[2] = press.force();
  return press;
}

// The one that is parallel to the plate, or -1.
int FaceColumns::column_beneath(int i) const {
  const double *q = bonds_->quaternion(i);
  const Rotation turned{q[0], Vec(q[1], q[2], q[3])};
  const std::vector<FaceColumn> &columns = columns_[atom_->tag[i]];
  for (size_t k = 0; k < columns.size(); k++)
    if (-turned(columns[k].normal).z > std::cos(PARALLEL_rad)) return static_cast<int>(k);
  return -1;
}

double FaceColumns::outside_of(int i) {
  double most = 0;
  if (may_press(i))
    for (const FaceColumn &c : columns_[atom_->tag[i]]) most = std::max(most, c.height - atom_->radius[i]);
  return most;
}

// Bonds break, and do not come back.
bool FaceColumns::may_press(int i) {
  const int tag = atom_->tag[i];
  return !columns_[tag].empty() && (memory_.row(i)[0] > 0 || has_its_bonds(tag));
}

// A face that presses goes on however the body turns.
void FaceColumns::add_faces(int i, std::vector<Face> &faces) {
  const int tag = atom_->tag[i];
  const std::vector<FaceColumn> &columns = columns_[tag];
  const int pressing = static_cast<int>(memory_.row(i)[0]) - 1;
  if (!may_press(i)) return;
  const double *q = bonds_->quaternion(i);
  const Rotation turned{q[0], Vec(q[1], q[2], q[3])};
  for (int k = 0; k < static_cast<int>(columns.size()); k++)
    faces.push_back({Vec(atom_->x[i]), columns[k].height, turned(columns[k].normal), k == pressing ? M_PI : PARALLEL_rad});
}

bool FaceColumns::has_its_bonds(int tag) {
  if (counted_ != bonds_->changes()) {
    counted_ = bonds_->changes();
    held_.assign(columns_.size(), 0), all_.assign(columns_.size(), 0);
    for (const Bond &b : bonds_->bonds())
      for (const int end : {b.tag_i, b.tag_j}) all_[end]++, held_[end] += bonds_->holds(b.id);
  }
  return 2 * held_[tag] >= all_[tag];
}

}  // namespace LAMMPS_NS
