// The values of a patch's cells in the type that their file has them in: float32 stays float32 in memory.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "structures/mesh/cell_memory.hpp"

namespace amrtex {

enum class RealType { float32, float64 };

inline const char* name_of(RealType type) { return type == RealType::float32 ? "float32" : "float64"; }
inline std::size_t bytes_of(RealType type) { return type == RealType::float32 ? sizeof(float) : sizeof(double); }

/// Leaves new numbers as they are in memory: whoever asks for an array fills it, and writing it twice costs as much as reading a
/// file does. Arrays lie in `memory` where there is one with room, which lives as long as they do.
template <class T>
class UnsetAllocator {
 public:
  using value_type = T;
  using propagate_on_container_move_assignment = std::true_type;
  using propagate_on_container_swap = std::true_type;

  UnsetAllocator() = default;
  explicit UnsetAllocator(std::shared_ptr<CellMemory> memory) : memory_(std::move(memory)) {}
  template <class U>
  UnsetAllocator(const UnsetAllocator<U>& other) : memory_(other.memory()) {}

  T* allocate(std::size_t count) {
    if (memory_ && count <= std::numeric_limits<std::size_t>::max() / sizeof(T))
      if (void* place = memory_->take(count * sizeof(T))) return static_cast<T*>(place);
    return std::allocator<T>().allocate(count);
  }
  void deallocate(T* array, std::size_t count) noexcept {
    if (!memory_ || !memory_->holds(array)) std::allocator<T>().deallocate(array, count);
  }
  template <class U>
  void construct(U* at) noexcept {
    ::new (static_cast<void*>(at)) U;
  }
  template <class U, class... Args>
  void construct(U* at, Args&&... args) {
    ::new (static_cast<void*>(at)) U(std::forward<Args>(args)...);
  }
  /// Copies are arrays of their own: they need not live as long as the memory's others.
  UnsetAllocator select_on_container_copy_construction() const { return {}; }
  const std::shared_ptr<CellMemory>& memory() const { return memory_; }
  bool operator==(const UnsetAllocator&) const = default;

 private:
  std::shared_ptr<CellMemory> memory_;
};
template <class T>
using CellArray = std::vector<T, UnsetAllocator<T>>;

/// Some of the cells of a patch, with the number of each among them.
class CellSet {
 public:
  /// The cells where `mask` is 0.
  explicit CellSet(std::span<const std::uint8_t> mask);

  bool holds(std::size_t cell) const { return (words_[cell / 64].bits >> (cell % 64) & 1) != 0; }
  /// How many of them come before the cell.
  std::size_t rank(std::size_t cell) const {
    const Word& word = words_[cell / 64];
    const std::uint64_t below = word.bits & ((std::uint64_t{1} << (cell % 64)) - 1);
    return word.before + static_cast<std::size_t>(std::popcount(below));
  }
  std::size_t count() const { return count_; }

 private:
  struct Word {
    std::uint64_t bits = 0;
    std::size_t before = 0;
  };
  std::vector<Word> words_;
  std::size_t count_ = 0;
};

/// Reading one number a cell costs a look at the type each time; visit() looks once for all of them.
class CellValues {
 public:
  CellValues() = default;  ///< of no cell
  /// Still to be set; in `memory` where there is one with room.
  CellValues(RealType type, std::size_t cells, const std::shared_ptr<CellMemory>& memory = nullptr);
  CellValues(const std::vector<double>& values) : values_(CellArray<double>(values.begin(), values.end())) {}
  CellValues(CellArray<double> values) : values_(std::move(values)) {}
  CellValues(CellArray<float> values) : values_(std::move(values)) {}

  RealType type() const { return std::holds_alternative<CellArray<float>>(values_) ? RealType::float32 : RealType::float64; }
  std::size_t size() const {
    return std::visit([](const auto& stored) { return stored.size(); }, values_);
  }
  double operator[](std::size_t cell) const {
    if (const auto* wide = std::get_if<CellArray<double>>(&values_)) return (*wide)[cell];
    if (means_.cells && means_.cells->holds(cell)) return means_.values[means_.cells->rank(cell)];
    return static_cast<double>((*std::get_if<CellArray<float>>(&values_))[cell]);
  }

  /// Calls f(view), where view[cell] is the cell's value as a double, and returns what f does.
  template <class F>
  decltype(auto) visit(F&& f) const {
    if (const auto* wide = std::get_if<CellArray<double>>(&values_)) return f(Plain<double>{wide->data()});
    const auto& narrow = std::get<CellArray<float>>(values_);
    if (!means_.cells) return f(Plain<float>{narrow.data()});
    return f(WithMeans{narrow.data(), means_.cells.get(), means_.values.data()});
  }
  /// Calls f with the CellArray of float or double that holds what the file said.
  template <class F>
  decltype(auto) visit_stored(F&& f) {
    return std::visit(std::forward<F>(f), values_);
  }
  template <class F>
  decltype(auto) visit_stored(F&& f) const {
    return std::visit(std::forward<F>(f), values_);
  }

  /// Sets the value of a cell, rounded to the type.
  void set(std::size_t cell, double value);
  /// From now on these cells hold means, doubles whatever the type: a mean of float32 is none, and everything that reads it
  /// would see the rounding.
  void hold_means(std::shared_ptr<const CellSet> cells);
  /// Sets one of those cells.
  void set_mean(std::size_t cell, double mean);

  /// Values from the cell `first` on, as many as `out` has.
  void copy(std::size_t first, std::span<double> out) const;
  std::vector<double> doubles() const;

  /// For loops over few cells.
  class Iterator {
   public:
    Iterator(const CellValues* values, std::size_t cell) : values_(values), cell_(cell) {}
    double operator*() const { return (*values_)[cell_]; }
    Iterator& operator++() {
      ++cell_;
      return *this;
    }
    bool operator!=(const Iterator& other) const { return cell_ != other.cell_; }

   private:
    const CellValues* values_;
    std::size_t cell_;
  };
  Iterator begin() const { return {this, 0}; }
  Iterator end() const { return {this, size()}; }

 private:
  template <class T>
  struct Plain {
    const T* values;
    double operator[](std::size_t cell) const { return static_cast<double>(values[cell]); }
  };
  struct WithMeans {
    const float* values;
    const CellSet* cells;
    const double* means;
    double operator[](std::size_t cell) const {
      return cells->holds(cell) ? means[cells->rank(cell)] : static_cast<double>(values[cell]);
    }
  };
  struct Means {
    std::shared_ptr<const CellSet> cells;  ///< the same ones for all fields of a patch; null: none
    std::vector<double> values;
  };

  std::variant<CellArray<double>, CellArray<float>> values_;
  Means means_;  ///< of float32 where cells are refined
};

}  // namespace amrtex
