#include "bench/measure/gpu_state.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>
#include <fstream>
#include <memory>
#include <sstream>
#include <utility>
#include <vector>

namespace amrtex {
namespace {

namespace fs = std::filesystem;

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\n' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\n' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

/// The number that the text begins with: "[N/A]" has none.
std::optional<double> number_in(std::string_view text) {
  text = trimmed(text);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc()) return std::nullopt;
  return value;
}

std::string text_of(const fs::path& file) {
  std::ifstream in(file);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

std::optional<double> scaled(std::optional<double> value, double factor) {
  if (!value) return std::nullopt;
  return *value * factor;
}

/// The first folder `hwmon/hwmonN` of a device.
fs::path sensors_of(const fs::path& device) {
  std::error_code failure;
  for (const auto& entry : fs::directory_iterator(device / "hwmon", failure)) return entry.path();
  return {};
}

/// "0000:65:00.0" of a device node, where the system knows it.
std::string pci_address(const fs::path& device) {
  std::error_code failure;
  const fs::path real = fs::canonical(device, failure);
  return failure ? "" : real.filename().string();
}

/// The first line that a program writes; empty where it cannot be run or fails.
std::string first_line_of(const std::string& command) {
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(::popen(command.c_str(), "r"), [](FILE* f) { return f != nullptr ? ::pclose(f) : 0; });
  if (!pipe) return "";
  std::array<char, 512> line{};
  return std::fgets(line.data(), static_cast<int>(line.size()), pipe.get()) != nullptr ? line.data() : "";
}

/// One word of a shell's command line.
std::string shell_word(const std::string& text) {
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return word + "'";
}

Json json_of(const std::optional<double>& value) { return value ? Json(*value) : Json(); }

}  // namespace

Json to_json(const GpuState& state) {
  if (!state.known()) return nullptr;
  return {{"clock_mhz", json_of(state.clock_mhz)},
          {"memory_clock_mhz", json_of(state.memory_clock_mhz)},
          {"temperature_c", json_of(state.temperature_c)},
          {"throttled", state.throttled ? Json(*state.throttled) : Json()},
          {"source", state.source}};
}

GpuState parse_nvidia_smi(std::string_view line) {
  std::vector<std::string_view> parts;
  for (std::string_view rest = line; parts.size() < 4;) {
    const std::size_t comma = rest.find(',');
    parts.push_back(trimmed(rest.substr(0, comma)));
    if (comma == std::string_view::npos) break;
    rest.remove_prefix(comma + 1);
  }
  GpuState state;
  if (parts.size() < 4 || !number_in(parts[0])) return state;
  state.clock_mhz = number_in(parts[0]);
  state.memory_clock_mhz = number_in(parts[1]);
  state.temperature_c = number_in(parts[2]);
  // bit 0 is an idle GPU, which is no throttling
  std::uint64_t bits = 0;
  if (parts[3].starts_with("0x") &&
      std::from_chars(parts[3].data() + 2, parts[3].data() + parts[3].size(), bits, 16).ec == std::errc())
    state.throttled = (bits & ~std::uint64_t{1}) == 0 ? "no" : std::string(parts[3]);
  state.source = "nvidia-smi";
  return state;
}

std::optional<double> parse_amd_clock(std::string_view text) {
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    const std::size_t colon = line.find(':');
    if (line.find('*') != std::string_view::npos && colon != std::string_view::npos) return number_in(line.substr(colon + 1));
    text.remove_prefix(std::min(line.size() + 1, text.size()));
  }
  return std::nullopt;
}

GpuStateReader::GpuStateReader(const GlContextInfo& info, std::string nvidia_smi, fs::path sysfs) {
  if (info.software) return;
  if (!info.device_file.empty()) {
    const fs::path folder = sysfs / "class" / "drm" / fs::path(info.device_file).filename() / "device";
    std::error_code failure;
    if (fs::exists(folder, failure)) device_ = folder;
  }
  if (!info.vendor.starts_with("NVIDIA")) return;
  nvidia_smi_ = std::move(nvidia_smi);
  // CUDA's numbers and nvidia-smi's may differ: the address on the bus is the same for all
  nvidia_device_ = device_.empty() ? "" : pci_address(device_);
  if (nvidia_device_.empty() && info.cuda_index >= 0) nvidia_device_ = fmt::format("{}", info.cuda_index);
}

GpuState GpuStateReader::read_nvidia() const {
  const std::string which = nvidia_device_.empty() ? "" : " -i " + shell_word(nvidia_device_);
  return parse_nvidia_smi(first_line_of(fmt::format(
      "{}{} --query-gpu=clocks.sm,clocks.mem,temperature.gpu,clocks_throttle_reasons.active --format=csv,noheader,nounits 2>/dev/null",
      shell_word(nvidia_smi_), which)));
}

GpuState GpuStateReader::read_files() const {
  const fs::path sensors = sensors_of(device_);
  GpuState state;
  state.clock_mhz = parse_amd_clock(text_of(device_ / "pp_dpm_sclk"));
  state.memory_clock_mhz = parse_amd_clock(text_of(device_ / "pp_dpm_mclk"));
  if (!sensors.empty()) {
    state.temperature_c = scaled(number_in(text_of(sensors / "temp1_input")), 1e-3);
    if (!state.clock_mhz) state.clock_mhz = scaled(number_in(text_of(sensors / "freq1_input")), 1e-6);
  }
  // Intel's clocks lie beside `device`
  const fs::path card = device_.parent_path();
  if (!state.clock_mhz) state.clock_mhz = number_in(text_of(card / "gt_act_freq_mhz"));
  if (const auto throttled = number_in(text_of(card / "gt" / "gt0" / "throttle_reason_status")))
    state.throttled = *throttled == 0 ? "no" : "throttle_reason_status";
  if (state.clock_mhz || state.temperature_c) state.source = device_.string();
  return state;
}

GpuState GpuStateReader::read() const {
  if (!nvidia_smi_.empty())
    if (GpuState state = read_nvidia(); state.known()) return state;
  return device_.empty() ? GpuState() : read_files();
}

}  // namespace amrtex
