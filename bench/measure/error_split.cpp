#include "bench/measure/error_split.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "renderers/consumers/raycaster.hpp"
#include "renderers/cpu/cpu_picture.hpp"
#include "renderers/cpu/sampled_reference.hpp"
#include "renderers/reference/hierarchy_reference.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

constexpr std::array<std::string_view, 8> kCauses = {"step",   "encoding",  "storage",   "arithmetic",
                                                     "driver", "filtering", "early_end", "level_of_detail"};

/// The pictures so far: the last one, and what their signed differences add up to.
class Chain {
 public:
  explicit Chain(const Picture& first) : last_(first), sum_(first.width, first.height, first.channels) {}

  void add(std::string_view cause, const Picture& picture) {
    causes_.push_back({cause, compare(picture, last_)});
    for (std::size_t i = 0; i < picture.values.size(); ++i) sum_.values[i] += picture.values[i] - last_.values[i];
    last_ = picture;
  }
  void leave_out(std::string_view cause) { causes_.push_back({cause, std::nullopt}); }

  double closes(const Picture& picture, const Picture& reference) const {
    double largest = 0;
    for (std::size_t i = 0; i < picture.values.size(); ++i)
      largest = std::max(largest, std::abs(sum_.values[i] - (picture.values[i] - reference.values[i])));
    return largest;
  }
  std::vector<CauseError> causes() && { return std::move(causes_); }

 private:
  Picture last_, sum_;
  std::vector<CauseError> causes_;
};

Scene without_detail(const Scene& scene) {
  Scene all = scene;
  all.settings.level_of_detail.reset();
  all.settings.max_level.reset();
  return all;
}

/// With all samples of the finest cells.
Scene without_shortcuts(const Scene& scene) {
  Scene all = without_detail(scene);
  all.settings.early_end.reset();
  return all;
}

/// The reference's values at the sample places of `field`.
Picture draw_samples(const SplitRequest& r, const Scene& scene, const EncodedField& field) {
  std::vector<std::unique_ptr<HierarchyReference>> references;
  for (int number = 0; number < field.field_count; ++number)
    references.push_back(
        std::make_unique<HierarchyReference>(r.hierarchy, r.structure.request.field_at(number), field.definition));
  const FieldValues values = [&](const FinestPosition& p, int number) {
    return references[static_cast<std::size_t>(number)]->sample(p);
  };
  return render_sampled(r.hierarchy, field, scene, values);
}

Picture draw_on(const SplitRequest& r, const Structure& structure, const Scene& scene) {
  Raycaster raycaster(r.context, r.hierarchy, structure, scene);
  raycaster.draw();
  return raycaster.read();
}

/// The structure where the shader filters it, else another build in which it does.
class ManualStructure {
 public:
  explicit ManualStructure(const SplitRequest& r) : given_(r.structure) {
    if (given_.field.filtering == Filtering::manual) return;
    BuildRequest request = given_.request;
    request.needs.filtering = Filtering::manual;
    built_ = std::make_unique<Structure>(r.context, r.encoding.build(r.hierarchy, request), request);
  }
  const Structure& get() const { return built_ ? *built_ : given_; }

 private:
  const Structure& given_;
  std::unique_ptr<Structure> built_;
};

BuildRequest exact_request(const SplitRequest& r) {
  BuildRequest request = r.structure.request;
  request.needs.filtering = Filtering::manual;
  request.memory_limit = std::numeric_limits<std::int64_t>::max();  // it stays on the CPU
  return request;
}

void add_context_pictures(const SplitRequest& r, const Scene& all, const Structure& manual, Chain& chain) {
  chain.add("driver", draw_on(r, manual, all));
  if (r.structure.field.filtering == Filtering::hardware)
    chain.add("filtering", draw_on(r, r.structure, all));
  else
    chain.leave_out("filtering");
  if (r.scene.settings.early_end)
    chain.add("early_end", draw_on(r, r.structure, without_detail(r.scene)));
  else
    chain.leave_out("early_end");
  if (r.scene.settings.prunes_levels())
    chain.add("level_of_detail", draw_on(r, r.structure, r.scene));
  else
    chain.leave_out("level_of_detail");
}

Json error_or_null(const std::optional<ErrorMetrics>& error) {
  if (!error) return nullptr;
  return {{"rmse", error->rmse}, {"max", error->max}};
}

}  // namespace

const std::optional<ErrorMetrics>& ErrorSplit::of(std::string_view cause) const {
  static const std::optional<ErrorMetrics> none;
  const auto found = std::find_if(causes.begin(), causes.end(), [&](const CauseError& c) { return c.cause == cause; });
  return found == causes.end() ? none : found->error;
}

ErrorSplit split_error(const SplitRequest& r) {
  if (r.scene.settings.consumer != ConsumerKind::raycast)
    throw UnsupportedError(fmt::format("explain_error: pictures of the consumer raycast are explained, not of {}",
                                       consumer_name(r.scene.settings.consumer)));
  const Scene all = without_shortcuts(r.scene);
  Chain chain(r.reference);
  const ManualStructure filtered(r);
  const Structure& manual = filtered.get();
  {
    const EncodedField exact = build_exact(r.encoding, r.hierarchy, exact_request(r));
    chain.add("step", draw_samples(r, all, exact));
    chain.add("encoding", render_on_cpu(r.hierarchy, exact, all, true));
    if (exact.storage == manual.field.storage)
      chain.leave_out("storage");  // one format alone: its error is the encoding's
    else
      chain.add("storage", render_on_cpu(r.hierarchy, manual.field, all, true));
  }
  chain.add("arithmetic", render_on_cpu(r.hierarchy, manual.field, all, false));
  add_context_pictures(r, all, manual, chain);
  ErrorSplit split;
  split.sum_closes = chain.closes(r.picture, r.reference);
  split.causes = std::move(chain).causes();
  if (r.truth != nullptr && !r.scene.settings.draws_surfaces() && r.scene.more_fields.empty()) {
    const HierarchyReference reference(r.hierarchy, r.structure.request.field, r.structure.field.definition);
    split.filter = compare(r.reference, reference.render(r.scene, r.rule, *r.truth));
  }
  return split;
}

std::vector<std::string_view> split_causes() { return {kCauses.begin(), kCauses.end()}; }

Json split_json(const ErrorSplit& split) {
  Json json;
  for (const CauseError& c : split.causes) json[std::string(c.cause)] = error_or_null(c.error);
  json["filter"] = error_or_null(split.filter);
  json["sum_closes"] = split.sum_closes;
  return json;
}

EncodedField build_exact(const Encoding& encoding, const AmrHierarchy& hierarchy, BuildRequest request) {
  const Storage storage = request.storage;
  request.storage = Storage::r64f;
  try {
    return encoding.build(hierarchy, request);
  } catch (const UnsupportedError&) {
    request.storage = storage;
    return encoding.build(hierarchy, request);
  }
}

}  // namespace amrtex
