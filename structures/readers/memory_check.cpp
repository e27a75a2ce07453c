#include "structures/readers/memory_check.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include "structures/mesh/error.hpp"

namespace amrtex {

void require_memory(const std::filesystem::path& path, CheckedSize cells, std::size_t fields, std::size_t bytes_each) {
  const CheckedSize bytes = cells * static_cast<std::int64_t>(fields * bytes_each);
  const double memory = static_cast<double>(::sysconf(_SC_PHYS_PAGES)) * static_cast<double>(::sysconf(_SC_PAGESIZE));
  const auto needed = static_cast<double>(bytes.or_most());
  if (needed > memory)
    throw BudgetError(fmt::format("{}: the values of {} fields take {:.3e} bytes, this machine has {:.3e}", path.string(), fields,
                                  needed, memory));
}

}  // namespace amrtex
