#include "bench/measure/left_out_time.hpp"

#include "bench/measure/stopwatch.hpp"
#include "bench/numbers/statistics.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

double build_seconds(const Encoding& encoding, const AmrHierarchy& h, const BuildRequest& request) {
  const Stopwatch watch;
  const EncodedField built = encoding.build(h, request);
  return watch.seconds();
}

}  // namespace

void time_left_out(const Encoding& encoding, const AmrHierarchy& hierarchy, const BuildRequest& request, EncodedField& field,
                   int pairs) {
  for (LeftOut& item : field.left_out) {
    if (item.need == Need::none) continue;
    BuildRequest with = request;
    with.needs = with_need(request.needs, item.need);
    try {
      build_seconds(encoding, hierarchy, with);  // not counted: its pages of memory are the first
      std::vector<double> saved;
      for (int i = 0; i < pairs; ++i) {  // one after the other, so that what drifts concerns both
        const double without = build_seconds(encoding, hierarchy, request);
        saved.push_back(build_seconds(encoding, hierarchy, with) - without);
      }
      item.seconds = median(saved);
    } catch (const UnsupportedError&) {
    } catch (const BudgetError&) {
    }
  }
}

}  // namespace amrtex
