#include "reach_pairs.h"

#include <algorithm>
#include <numeric>

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

ReachPairs::ReachPairs(const std::vector<Outline *> &bodies, double time_s, double unforeseen_m_s)
    : others_(bodies.size()) {
  std::vector<Box> boxes;
  for (const Outline *body : bodies) boxes.push_back(box_of(*body, time_s, unforeseen_m_s));
  std::vector<int> order(bodies.size()), open;
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int a, int b) { return boxes[a].low.x < boxes[b].low.x; });
  for (const int k : order) {
    size_t kept = 0;
    for (const int other : open) {
      if (boxes[other].high.x < boxes[k].low.x) continue;
      open[kept++] = other;
      if (!boxes[k].overlaps_aside(boxes[other])) continue;
      others_[k].push_back(other);
      others_[other].push_back(k);
    }
    open.resize(kept);
    open.push_back(k);
  }
  for (std::vector<int> &others : others_) std::sort(others.begin(), others.end());
}

}  // namespace LAMMPS_NS
