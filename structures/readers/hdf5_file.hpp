// HDF5 files, read as files that somebody else made. Every failure of the library becomes an Error that names file and
// object, and nothing is printed. Only this file is read: external links, external raw storage and virtual data sets are
// refused. No plugin is ever loaded. Sizes are held against what is stored before anything is allocated.
//
// Our own checks are promised; inside of the HDF5 library a file made to attack it may still find a fault.
#pragma once

#include <tbb/parallel_for.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "structures/mesh/cell_values.hpp"
#include "structures/mesh/spaces.hpp"

namespace amrtex {

/// Extents of a data set, the slowest axis first.
using Hdf5Shape = std::vector<std::uint64_t>;

/// An array of whole numbers or reals with its extents.
template <class T>
struct Hdf5Array {
  Hdf5Shape shape;
  std::vector<T> values;  ///< the last axis fastest
};

/// A data set of reals that is open. Contiguous float32 and float64 of this machine are read by their place in the file,
/// all else through the library.
class Hdf5Numbers {
 public:
  const Hdf5Shape& shape() const;
  std::uint64_t count() const;
  int bytes_each() const;  ///< of a value in the file
  /// What holds every value exactly; float64 for those that are wider.
  RealType type() const;
  /// May several threads read at once? The library takes one call at a time.
  bool parallel() const;
  /// Reads values from the flat position `first` on, as many as `out` has, which are of type(). Where the data set has several
  /// axes and goes through the library, these have to be whole rows of the first one.
  template <class T>
  void read(std::uint64_t first, std::span<T> out) const;
  /// Reads what `valid` holds of an array over `stored` that begins at the flat position `first`, x fastest.
  CellValues read_box(std::uint64_t first, const Box& stored, const Box& valid) const;

 private:
  friend class Hdf5File;
  struct Data;
  template <class T>
  void read_within(std::uint64_t first, const Box& stored, const Box& valid, std::span<T> out) const;
  std::shared_ptr<const Data> data_;
};

class Hdf5File {
 public:
  /// Does the file begin as HDF5 files do? Any path may be asked.
  static bool has_signature(const std::filesystem::path& path);
  /// Opens for reading.
  explicit Hdf5File(const std::filesystem::path& path);

  const std::filesystem::path& path() const;
  /// Throws Error "<file>: <object>: <what>".
  [[noreturn]] void fail(std::string_view object, std::string_view what) const;

  bool has(const std::string& object) const;
  bool has_attribute(const std::string& object, const std::string& attribute) const;
  /// Names in a group, in alphabetical order.
  std::vector<std::string> members(const std::string& group) const;

  /// Whole numbers of an attribute, one or more. Of a compound: of these members, or of all where none is named.
  std::vector<std::int64_t> integers(const std::string& object, const std::string& attribute,
                                     const std::vector<std::string>& names = {}) const;
  std::int64_t integer(const std::string& object, const std::string& attribute) const;
  std::vector<double> reals(const std::string& object, const std::string& attribute) const;
  /// A text of fixed or variable length, without what fills it up.
  std::string text(const std::string& object, const std::string& attribute) const;

  Hdf5Array<std::int64_t> read_integers(const std::string& dataset) const;
  Hdf5Array<double> read_reals(const std::string& dataset) const;
  /// These members of a data set of compounds, row by row.
  std::vector<std::int64_t> read_records(const std::string& dataset, const std::vector<std::string>& names) const;
  /// Texts of fixed length as they are stored, with the blanks behind them.
  std::vector<std::string> read_texts(const std::string& dataset) const;
  /// Lists of compounds {name, value}, as FLASH writes them; blanks behind names and texts are left out.
  std::vector<std::pair<std::string, std::int64_t>> read_named_integers(const std::string& dataset) const;
  std::vector<std::pair<std::string, double>> read_named_reals(const std::string& dataset) const;
  std::vector<std::pair<std::string, std::string>> read_named_texts(const std::string& dataset) const;

  /// Axes of a data set; 0 for anything that is not one of reals.
  std::size_t rank_of_reals(const std::string& object) const;
  /// Opens a data set of reals with so many axes.
  Hdf5Numbers open_numbers(const std::string& dataset, std::size_t rank) const;

 private:
  friend class Hdf5Numbers;
  struct State;
  std::shared_ptr<State> state_;
};

/// "(4, 8, 8)".
std::string text(const Hdf5Shape& shape);

/// Calls f(i) for i below `count`: at the same time on all cores where Hdf5Numbers are read that allow it, else in order.
template <class F>
void for_each_index(std::size_t count, bool parallel, F&& f) {
  if (parallel)
    tbb::parallel_for(std::size_t{0}, count, f);
  else
    for (std::size_t i = 0; i < count; ++i) f(i);
}

}  // namespace amrtex
