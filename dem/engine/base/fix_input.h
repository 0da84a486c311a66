#pragma once
#include <functional>
#include <string>
#include <vector>

#include "base/vec.h"

namespace LAMMPS_NS {

class Fix;
class LAMMPS;

enum class Allowed { ANY, FROM_0, ABOVE_0 };  // of a number; none of them allows infinity

// What a fix takes. It declares its keywords, each with what may follow it, and reads its line of the deck. What is not
// allowed, there, in its files or at `init`, ends the engine in one line with the fix, what was found and what is
// allowed. All ranks find the same and call together.
class FixInput {
 public:
  // `style`: by which errors name the fix, where it has that of a stock fix it derives from.
  FixInput(LAMMPS *lmp, Fix *fix, std::string style = "") : lmp_(lmp), fix_(fix), style_(std::move(style)) {}

  FixInput &text(const std::string &key, std::string &value);
  FixInput &whole(const std::string &key, int &value, int least);
  FixInput &number(const std::string &key, double &value, Allowed allowed);
  FixInput &numbers(const std::string &key, double *values, int count, Allowed allowed);
  FixInput &direction(const std::string &key, Vec &unit_vector);
  // Other keywords: `take` gets the `count` words that follow, or with ALL_THE_REST those to the end of the line.
  using Take = std::function<void(char **words, int count)>;
  FixInput &words(const std::string &key, int count, Take take);
  static const int ALL_THE_REST = -1;
  // The words from `first` to before `end`; `required` are the keywords that must be among them.
  void read(char **arg, int first, int end, const std::vector<std::string> &required) const;

  double number(const std::string &what, const char *word, Allowed allowed) const;
  int whole(const std::string &what, const char *word, int least) const;
  double checked(const std::string &what, double value, Allowed allowed) const;
  [[noreturn]] void refuse(const std::string &why) const;

 private:
  struct Keyword {
    std::string key;
    int count;
    Take take;
  };
  LAMMPS *lmp_;
  Fix *fix_;
  std::string style_;
  std::vector<Keyword> keywords_;
};

}  // namespace LAMMPS_NS
