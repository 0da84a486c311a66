#pragma once
#include <cstdio>
#include <cstring>
#include <type_traits>
#include <vector>

namespace LAMMPS_NS {

// Things that are kept in a row of numbers of a checkpoint as they lie in memory. An empty vector points to null, which
// neither memcpy nor fwrite may be given.

template <class T> void append_bytes(std::vector<double> &row, const T *from, size_t count) {
  static_assert(std::is_trivially_copyable<T>::value && sizeof(T) % sizeof(double) == 0, "kept as it lies in memory");
  if (count == 0) return;
  const size_t at = row.size();
  row.resize(at + count * sizeof(T) / sizeof(double));
  std::memcpy(static_cast<void *>(row.data() + at), from, count * sizeof(T));
}

template <class T> void take_bytes(const double *&row, T *to, size_t count) {
  if (count == 0) return;
  std::memcpy(static_cast<void *>(to), row, count * sizeof(T));
  row += count * sizeof(T) / sizeof(double);
}

// False if the file does not take it.
template <class T> bool write_all(const std::vector<T> &row, FILE *out) {
  return row.empty() || std::fwrite(row.data(), sizeof(T), row.size(), out) == row.size();
}

}  // namespace LAMMPS_NS
