#include "smooth/stone_surface.h"

#include <algorithm>
#include <cmath>
#include <fstream>

#include "error.h"
#include "lammps.h"
#include "contact/plate_contact.h"

namespace LAMMPS_NS {

StoneSurfaces::StoneSurfaces(LAMMPS *lmp, const std::string &file, const Agglomerates &agglomerates)
    : place_(agglomerates.tags() + 1), radius_(place_.size(), 0), mass_(radius_), surface_(place_.size(), 0) {
  std::ifstream in(file);
  std::string word;
  in >> outside_ >> height_;
  const auto stones = in.tellg();
  if (in >> word && word == "stream") {
    stones_.resize(agglomerates.count());
  } else {
    in.seekg(stones);
    read_stones(in, agglomerates);
  }
  if (!in) lmp->error->all(FLERR, ("Cannot read the surfaces of the stones from " + file).c_str());
}

void StoneSurfaces::read_stones(std::istream &in, const Agglomerates &agglomerates) {
  int tag = 1;
  for (int a = 0; a < agglomerates.count() && in; a++) {
    SmoothStone s;
    s.first_tag = tag;
    in >> s.count >> s.radius >> s.patch_radius >> s.modulus >> s.shear_modulus >> s.damping_ratio >>
        s.damping_ratio_across >> s.friction >> s.yield_pressure >> s.compliance_first >> s.compliance >>
        s.across_first >> s.across;
    if (s.count != agglomerates.size(a) || !(std::min({s.radius, s.patch_radius, s.modulus}) > 0))
      in.setstate(std::ios::failbit);
    stones_.push_back(s);
    for (int k = 0; k < s.count && in && tag <= agglomerates.tags(); k++, tag++) {
      double row[EnteringStone::SURFACE_COLUMNS];
      for (double &number : row) in >> number;
      put(tag, row);
    }
  }
  if (tag != agglomerates.tags() + 1) in.setstate(std::ios::failbit);
}

void StoneSurfaces::put(int tag, const double *row) {
  place_[tag] = Vec(row);
  radius_[tag] = row[3], mass_[tag] = row[4];
  surface_[tag] = row[5] != 0;
}

void StoneSurfaces::enter(const EnteringStone &e) {
  SmoothStone &s = stones_[e.agglomerate];
  s.first_tag = e.first_tag, s.count = e.count();
  double *const numbers[] = {&s.radius, &s.patch_radius, &s.modulus, &s.shear_modulus, &s.damping_ratio,
                             &s.damping_ratio_across, &s.friction, &s.yield_pressure, &s.compliance_first,
                             &s.compliance, &s.across_first, &s.across};
  for (int k = 0; k < EnteringStone::CONTACT_NUMBERS; k++) *numbers[k] = e.contact[k];
  for (int k = 0; k < s.count; k++) put(s.first_tag + k, &e.surface[k * EnteringStone::SURFACE_COLUMNS]);
}

std::vector<StoneSurfaces::Weight> StoneSurfaces::weights(const SmoothStone &s, const Vec &axis,
                                                          const std::function<bool(int)> &belong,
                                                          double &share) const {
  const Vec aside = cross(axis, std::fabs(axis.x) < 0.5 ? Vec(1, 0, 0) : Vec(0, 1, 0));
  const Vec e1 = (1 / norm(aside)) * aside, e2 = cross(axis, e1);
  double all = 0, held = 0, u = 0, v = 0, uu = 0, uv = 0, vv = 0;
  std::vector<Weight> members;
  for (int tag = s.first_tag; tag < s.first_tag + s.count; tag++) {
    if (!surface_[tag] || dot(place_[tag], axis) <= 0) continue;
    const double a = dot(place_[tag], e1), b = dot(place_[tag], e2);
    const double inside = 1 - (a * a + b * b) / (s.patch_radius * s.patch_radius);
    if (inside <= 0) continue;
    const double w = radius_[tag] * radius_[tag] * inside;
    all += w;
    if (!belong(tag)) continue;
    held += w, u += w * a, v += w * b, uu += w * a * a, uv += w * a * b, vv += w * b * b;
    members.push_back({tag, w});
  }
  share = all > 0 ? held / all : 0;
  const double det = uu * vv - uv * uv;
  if (static_cast<int>(members.size()) < PlateContact::LEAST_IN_PATCH || !(det > 1e-6 * uu * vv)) return {};
  const double g = -(vv * u - uv * v) / det, h = -(uu * v - uv * u) / det;
  double total = 0;
  for (Weight &m : members) {
    m.weight *= std::max(0.0, 1 + g * dot(place_[m.tag], e1) + h * dot(place_[m.tag], e2));
    total += m.weight;
  }
  for (Weight &m : members) m.weight /= total;
  return members;
}

}  // namespace LAMMPS_NS
