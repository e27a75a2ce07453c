// Clock, temperature and throttling of a GPU, as far as the machine tells: by nvidia-smi, or by the files of its Linux driver.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "renderers/context/context.hpp"
#include "structures/mesh/json.hpp"

namespace amrtex {

struct GpuState {
  std::optional<double> clock_mhz;         ///< of the shader cores
  std::optional<double> memory_clock_mhz;
  std::optional<double> temperature_c;
  std::optional<std::string> throttled;    ///< the driver's words or bits; "no" where it says that nothing throttles
  std::string source;                      ///< "nvidia-smi", "/sys/class/drm/card0/device"; empty: the machine does not tell

  bool known() const { return !source.empty(); }
};
/// Null where nothing is known.
Json to_json(const GpuState& state);

/// Where the state of one GPU is read.
class GpuStateReader {
 public:
  /// For the context's device. `nvidia_smi` is the program's name or path, `sysfs` the root of the file system with its files.
  explicit GpuStateReader(const GlContextInfo& info, std::string nvidia_smi = "nvidia-smi", std::filesystem::path sysfs = "/sys");

  /// Takes some tens of milliseconds with nvidia-smi, less than one with files.
  GpuState read() const;

 private:
  GpuState read_nvidia() const;
  GpuState read_files() const;

  std::string nvidia_smi_;        ///< empty: not asked
  std::string nvidia_device_;     ///< what its option -i takes
  std::filesystem::path device_;  ///< folder of the driver's files; empty: there is none
};

/// A line of `nvidia-smi --query-gpu=clocks.sm,clocks.mem,temperature.gpu,clocks_throttle_reasons.active`.
GpuState parse_nvidia_smi(std::string_view line);
/// MHz of the line with a star in amdgpu's `pp_dpm_sclk`, as "1: 1800Mhz *".
std::optional<double> parse_amd_clock(std::string_view text);

}  // namespace amrtex
