// Where a picture's error comes from. Pictures are drawn with one cause after the other let in; the
// difference of each to the one before is that cause's, and the differences add up to the whole error.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "bench/numbers/image_error.hpp"
#include "renderers/context/context.hpp"
#include "renderers/gpu/structure.hpp"
#include "renderers/scene/reference_rule.hpp"
#include "renderers/scene/scene.hpp"
#include "structures/generators/synthetic.hpp"

namespace amrtex {

/// What there is to explain. All of it must outlive the call alone.
struct SplitRequest {
  const AmrHierarchy& hierarchy;
  const Encoding& encoding;
  const Structure& structure;  ///< on the context
  Context& context;
  const Scene& scene;
  const Picture& reference;              ///< the double reference of the field's own filter
  const Picture& picture;                ///< of the context: what is judged
  ReferenceRule rule = {};               ///< for the analytic field
  const AnalyticField* truth = nullptr;  ///< that the mesh samples; null where there is none
};

/// In the order of the chain:
///   step        the reference's own values at the picture's sample places, in double
///   encoding    the structure in double with a double payload
///   storage     the payload in its storage, still in double
///   arithmetic  the shader's text on the CPU, in float
///   driver      the same on the context, with manual filtering
///   filtering   the texture unit filters
///   early_end   rays end at the scene's opacity
///   level_of_detail  refined cells are drawn themselves
struct CauseError {
  std::string_view cause;
  std::optional<ErrorMetrics> error;  ///< against the picture before; absent where the picture has no such cause
};

struct ErrorSplit {
  std::vector<CauseError> causes;
  std::optional<ErrorMetrics> filter;  ///< the reference against the analytic field; no part of the picture's error
  double sum_closes = 0;               ///< largest |sum of all signed differences - (picture - reference)| of a value

  const std::optional<ErrorMetrics>& of(std::string_view cause) const;
};

/// Draws the chain: three to four pictures on the CPU and up to five on the context, from up to two more builds.
/// All modes of the raycaster; throws UnsupportedError for other consumers. The analytic field in dvr, projection and mip alone.
ErrorSplit split_error(const SplitRequest& request);

/// Names of the causes, in order.
std::vector<std::string_view> split_causes();

/// `error.split` of a record: {cause: {"rmse", "max"} or null, ..., "filter": ..., "sum_closes": number}.
Json split_json(const ErrorSplit& split);

/// The same structure with a double payload: what the encoding itself does to the field. Layouts that
/// hold samples of one format alone keep that.
EncodedField build_exact(const Encoding& encoding, const AmrHierarchy& hierarchy, BuildRequest request);

}  // namespace amrtex
