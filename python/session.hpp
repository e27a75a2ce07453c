// What the module keeps while Python runs: the thread that draws, and how its callers wait for it.
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "python/drawing.hpp"
#include "python/worker.hpp"

namespace amrtex {

class Session {
 public:
  /// The one of this process. It never ends: other threads may still draw when Python does.
  static Session& instance();

  /// Does the work on the thread that draws, without the interpreter's lock. Ctrl-C ends the waiting: the work goes on to its
  /// end, nobody takes what it makes, and the next work waits for it. `work` must own what it uses.
  template <class T>
  T call(std::function<T()> work) {
    auto result = std::make_shared<std::optional<T>>();
    const auto task = worker_.start([result, work = std::move(work)] { result->emplace(work()); });
    wait(task, nullptr);
    return std::move(**result);
  }
  /// Waits for other work; `cancel` ends it on Ctrl-C.
  void wait(const std::shared_ptr<Task>& task, const std::function<void()>& cancel);
  /// Ends what only the thread that draws may end.
  void end(std::function<void()> work) noexcept { worker_.leave(std::move(work)); }
  /// For that thread alone.
  Contexts& contexts() { return contexts_; }
  /// The end of the process: what is drawn in vain is not waited for.
  void finish() noexcept;

 private:
  Session() = default;

  Contexts contexts_;
  Worker worker_;
  std::shared_ptr<Task> in_vain_;
};

}  // namespace amrtex
