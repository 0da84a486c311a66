#include "flight/reach_pairs.h"

#include <algorithm>
#include <utility>

namespace LAMMPS_NS {

namespace {
struct Box {
  Vec low, high;
  bool overlaps_aside(const Box &b) const {
    return low.y <= b.high.y && b.low.y <= high.y && low.z <= b.high.z && b.low.z <= high.z;
  }
};

Box box_of(const Outline &body, double time_s, double unforeseen_m_s) {
  const double speed = norm(body.velocity) + body.spin * body.radius + unforeseen_m_s;
  const double reach = body.radius + time_s * speed;
  const Vec all(reach, reach, reach);
  return {body.center - all, body.center + all};
}
}  // namespace

ReachPairs::ReachPairs(const std::vector<Outline *> &bodies, size_t wanted, double time_s, double unforeseen_m_s)
    : others_(bodies.size()) {
  if (wanted == 0) return;
  std::vector<Box> boxes;
  for (const Outline *body : bodies) boxes.push_back(box_of(*body, time_s, unforeseen_m_s));
  std::vector<std::pair<double, int>> order;
  for (size_t k = 0; k < boxes.size(); k++) order.emplace_back(boxes[k].low.x, k);
  std::sort(order.begin(), order.end());
  std::vector<int> open[2];  // of the wanted ones, and of the others
  for (const auto &[low, k] : order) {
    const bool is_wanted = static_cast<size_t>(k) < wanted;
    for (int kind = 0; kind < (is_wanted ? 2 : 1); kind++) {
      size_t kept = 0;
      for (const int other : open[kind]) {
        if (boxes[other].high.x < low) continue;
        open[kind][kept++] = other;
        if (!boxes[k].overlaps_aside(boxes[other])) continue;
        others_[k].push_back(other);
        others_[other].push_back(k);
      }
      open[kind].resize(kept);
    }
    open[is_wanted ? 0 : 1].push_back(k);
  }
  for (std::vector<int> &others : others_) std::sort(others.begin(), others.end());
}

}  // namespace LAMMPS_NS
