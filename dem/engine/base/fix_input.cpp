#include "base/fix_input.h"

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cmath>
#include <cstdlib>

#include "error.h"
#include "fix.h"
#include "lammps.h"

namespace LAMMPS_NS {

namespace {
const double UNIT = 1e-6;  // how far a unit vector's length may be from one
}

FixInput &FixInput::text(const std::string &key, std::string &value) {
  return words(key, 1, [&value](char **words, int) { value = words[0]; });
}

FixInput &FixInput::whole(const std::string &key, int &value, int least) {
  return words(key, 1, [=, &value](char **words, int) { value = whole(key, words[0], least); });
}

FixInput &FixInput::number(const std::string &key, double &value, Allowed allowed) {
  return numbers(key, &value, 1, allowed);
}

FixInput &FixInput::numbers(const std::string &key, double *values, int count, Allowed allowed) {
  return words(key, count, [=](char **words, int) {
    for (int k = 0; k < count; k++) values[k] = number(key, words[k], allowed);
  });
}

FixInput &FixInput::direction(const std::string &key, Vec &unit_vector) {
  return words(key, 3, [=, &unit_vector](char **words, int) {
    unit_vector = Vec(number(key, words[0], Allowed::ANY), number(key, words[1], Allowed::ANY),
                      number(key, words[2], Allowed::ANY));
    if (!(std::fabs(norm(unit_vector) - 1) < UNIT))
      refuse(key + " " + words[0] + " " + words[1] + " " + words[2] + ": must be a unit vector");
  });
}

FixInput &FixInput::words(const std::string &key, int count, Take take) {
  keywords_.push_back({key, count, take});
  return *this;
}

void FixInput::read(char **arg, int first, int end, const std::vector<std::string> &required) const {
  std::vector<std::string> given;
  for (int k = first; k < end;) {
    const std::string key = arg[k++];
    auto known = std::find_if(keywords_.begin(), keywords_.end(), [&](const Keyword &one) { return one.key == key; });
    if (known == keywords_.end()) {
      std::string all;
      for (const Keyword &one : keywords_) all += (all.empty() ? "" : ", ") + one.key;
      refuse("unknown keyword " + key + "; allowed are " + all);
    }
    const int count = known->count == ALL_THE_REST ? end - k : known->count;
    if (k + count > end) refuse(key + ": must be followed by " + std::to_string(count) + " words");
    known->take(arg + k, count);
    given.push_back(key);
    k += count;
  }
  for (const std::string &key : required)
    if (std::find(given.begin(), given.end(), key) == given.end()) refuse("lacks the keyword " + key);
}

double FixInput::number(const std::string &what, const char *word, Allowed allowed) const {
  char *end = nullptr;
  const double value = std::strtod(word, &end);
  if (end == word || *end) refuse(what + " " + word + ": must be a number");
  return checked(what, value, allowed);
}

int FixInput::whole(const std::string &what, const char *word, int least) const {
  char *end = nullptr;
  errno = 0;
  const long value = std::strtol(word, &end, 10);
  if (end == word || *end || errno || value < least || value > INT_MAX)
    refuse(what + " " + word + ": must be a whole number from " + std::to_string(least) + " on");
  return static_cast<int>(value);
}

double FixInput::checked(const std::string &what, double value, Allowed allowed) const {
  const bool fits = allowed == Allowed::ANY || (allowed == Allowed::FROM_0 ? value >= 0 : value > 0);
  if (std::isfinite(value) && fits) return value;
  char found[32];
  std::snprintf(found, sizeof found, "%g", value);
  refuse(what + " " + found + ": must be a finite number" +
         (allowed == Allowed::ANY ? "" : allowed == Allowed::FROM_0 ? " from 0 on" : " above 0"));
}

void FixInput::refuse(const std::string &why) const {
  if (!style_.empty()) fix_->style = const_cast<char *>(style_.c_str());  // the engine ends here
  lmp_->error->fix_error(FLERR, fix_, why.c_str());
  std::abort();  // not reached
}

}  // namespace LAMMPS_NS
