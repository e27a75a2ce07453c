#include "renderers/context/context_probe.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <exception>

#include "renderers/context/egl_devices.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

using Clock = std::chrono::steady_clock;
// first byte of what the child sends
constexpr char kSuccess = '+';
constexpr char kFailure = '-';

class FileDescriptor {
 public:
  explicit FileDescriptor(int fd) : fd_(fd) {}
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;
  ~FileDescriptor() { close(); }
  int get() const { return fd_; }
  void close() {
    if (fd_ >= 0) ::close(fd_);
    fd_ = -1;
  }

 private:
  int fd_;
};

void write_all(int fd, std::string_view text) {
  while (!text.empty()) {
    const ssize_t n = ::write(fd, text.data(), text.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return;
    text.remove_prefix(static_cast<std::size_t>(n));
  }
}

[[noreturn]] void run_child(const std::function<std::string()>& work, int fd) {
  std::string message;
  try {
    message = kSuccess + work();
  } catch (const std::exception& e) {
    message = kFailure + std::string(e.what());
  } catch (...) {
    message = kFailure + std::string("unknown exception");
  }
  write_all(fd, message);
  // no exit handlers: they belong to the parent, and a driver's may hang
  _exit(0);
}

/// Reads until the writer closes. False when time is up first.
bool read_until(int fd, Clock::time_point deadline, std::string& text) {
  std::array<char, 4096> buffer;
  while (true) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now()).count();
    if (left <= 0) return false;
    pollfd waiting{fd, POLLIN, 0};
    const int ready = ::poll(&waiting, 1, static_cast<int>(std::min<long long>(left, 1000000)));
    if (ready <= 0) continue;
    const ssize_t n = ::read(fd, buffer.data(), buffer.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return true;
    text.append(buffer.data(), static_cast<std::size_t>(n));
  }
}

int wait_for(pid_t child) {
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return status;
}

void interpret(std::string_view sent, int status, ChildResult& result) {
  if (WIFSIGNALED(status))
    result.reason = fmt::format("crashed: signal {} ({})", WTERMSIG(status), strsignal(WTERMSIG(status)));
  else if (sent.empty())
    result.reason = fmt::format("ended without an answer, exit code {}", WEXITSTATUS(status));
  else
    (sent.front() == kSuccess ? result.text : result.reason) = sent.substr(1);
  result.ok = result.reason.empty() && !sent.empty();
}

}  // namespace

ChildResult run_in_child(const std::function<std::string()>& work, std::chrono::milliseconds timeout) {
  std::array<int, 2> ends{};
  if (::pipe(ends.data()) != 0) throw Error(fmt::format("pipe: {}", std::strerror(errno)));
  FileDescriptor in(ends[0]);
  FileDescriptor out(ends[1]);
  const auto start = Clock::now();
  const pid_t child = ::fork();
  if (child < 0) throw Error(fmt::format("fork: {}", std::strerror(errno)));
  if (child == 0) run_child(work, out.get());
  out.close();
  std::string sent;
  ChildResult result;
  result.timed_out = !read_until(in.get(), start + timeout, sent);
  if (result.timed_out) ::kill(child, SIGKILL);
  const int status = wait_for(child);
  result.seconds = std::chrono::duration<double>(Clock::now() - start).count();
  if (result.timed_out)
    result.reason = fmt::format("no answer within {:.1f} s", std::chrono::duration<double>(timeout).count());
  else
    interpret(sent, status, result);
  return result;
}

Json to_json(const GlContextInfo& info) {
  return {{"kind", info.kind},
          {"device", info.device >= 0 ? Json(info.device) : Json(nullptr)},
          {"device_file", info.device_file},
          {"cuda_index", info.cuda_index >= 0 ? Json(info.cuda_index) : Json(nullptr)},
          {"renderer", info.renderer},
          {"vendor", info.vendor},
          {"gl_version", info.version},
          {"glsl_version", info.glsl_version},
          {"environment", info.environment},
          {"software", info.software},
          {"bindless_texture", info.bindless_texture},
          {"sparse_texture", info.sparse_texture},
          {"shader_ballot", info.shader_ballot},
          {"handles_may_differ", info.handles_may_differ},
          {"max_resident_handles", info.has_handle_limit() ? Json(info.max_resident_handles) : Json(nullptr)},
          {"max_3d_texture_size", info.max_3d_texture_size},
          {"max_texture_bytes", info.has_texture_limit() ? Json(info.max_texture_bytes) : Json(nullptr)},
          {"max_buffer_bytes", info.max_buffer_bytes},
          {"max_texture_units", info.max_texture_units},
          {"max_storage_bindings", info.max_storage_bindings},
          {"max_viewport_width", info.max_viewport_width},
          {"max_viewport_height", info.max_viewport_height},
          {"max_compute_invocations", info.max_compute_invocations},
          {"timer_bits", info.timer_bits},
          {"total_memory_bytes", info.total_memory_bytes},
          {"free_memory_bytes", info.free_memory_bytes},
          {"extensions", info.extensions}};
}

GlContextInfo context_info_from_json(const Json& json) {
  GlContextInfo info;
  const auto read = [&](const char* key, auto& value) { json.at(key).get_to(value); };
  read("kind", info.kind);
  if (!json.at("device").is_null()) read("device", info.device);
  read("device_file", info.device_file);
  if (!json.at("cuda_index").is_null()) read("cuda_index", info.cuda_index);
  read("renderer", info.renderer);
  read("vendor", info.vendor);
  read("gl_version", info.version);
  read("glsl_version", info.glsl_version);
  read("environment", info.environment);
  read("software", info.software);
  read("bindless_texture", info.bindless_texture);
  read("sparse_texture", info.sparse_texture);
  read("shader_ballot", info.shader_ballot);
  read("handles_may_differ", info.handles_may_differ);
  if (!json.at("max_resident_handles").is_null()) read("max_resident_handles", info.max_resident_handles);
  read("max_3d_texture_size", info.max_3d_texture_size);
  if (!json.at("max_texture_bytes").is_null()) read("max_texture_bytes", info.max_texture_bytes);
  read("max_buffer_bytes", info.max_buffer_bytes);
  read("max_texture_units", info.max_texture_units);
  read("max_storage_bindings", info.max_storage_bindings);
  read("max_viewport_width", info.max_viewport_width);
  read("max_viewport_height", info.max_viewport_height);
  read("max_compute_invocations", info.max_compute_invocations);
  read("timer_bits", info.timer_bits);
  read("total_memory_bytes", info.total_memory_bytes);
  read("free_memory_bytes", info.free_memory_bytes);
  read("extensions", info.extensions);
  return info;
}

ContextProbe probe_context(const ContextChoice& choice, std::chrono::milliseconds timeout) {
  const ChildResult child = run_in_child([&] { return to_json(make_context(choice)->info()).dump(); }, timeout);
  ContextProbe probe{child.ok, child.timed_out, child.reason, {}, child.seconds};
  if (child.timed_out) probe.reason = fmt::format("context {}: starting gave {}", choice.name(), child.reason);
  if (child.ok) probe.info = context_info_from_json(Json::parse(child.text));
  return probe;
}

std::vector<ListedDevice> probe_devices(std::chrono::milliseconds timeout, std::string& reason) {
  const ChildResult child = run_in_child(
      [] {
        Json list = Json::array();
        for (const EglDevice& d : list_devices(EglLibrary()))
          list.push_back({{"index", d.index}, {"software", d.software}, {"text", d.text()}});
        return list.dump();
      },
      timeout);
  std::vector<ListedDevice> devices;
  if (child.ok)
    for (const Json& d : Json::parse(child.text)) devices.push_back({d.at("index"), d.at("software"), d.at("text")});
  reason = child.ok && devices.empty() ? "this EGL lists no devices" : child.reason;
  return devices;
}

}  // namespace amrtex
