// What a measuring process does: it reads questions and answers them, a line of JSON each.
//
//   {"plan": dataset}                                          -> {"points": [[build, render, "configuration", structure], ...]}
//   {"build": b, "renders": [r, ...], "repetition": n}         -> {"record": {...}} each, then {"done": true}
//   {"fail": b, "render": r, "repetition": n, "reason": "..."} -> {"record": {...}}
//
// Between them come {"phase": "building" | "drawing" | "other"} and {"shares": [seconds by share]}. What concerns the whole experiment is
// {"usage_error": "..."}, {"output_error": "..."} or {"error": "..."}, and ends the process.
#pragma once

#include "bench/measure/run_options.hpp"

namespace amrtex {

/// Answers questions on the descriptors until the one they come on is closed. Returns the exit code.
int answer_questions(const Experiment& experiment, const RunOptions& options, int questions, int answers);

}  // namespace amrtex
