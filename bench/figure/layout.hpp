// Panels on paper: where pictures, bars, keys and captions stand.
#pragma once

#include <vector>

#include "bench/figure/drawing.hpp"
#include "bench/figure/panel.hpp"
#include "bench/settings/figure_settings.hpp"

namespace amrtex {

/// Throws UsageError where a figure is too narrow for its panels.
Drawing lay_out(const FigureSpec& figure, const std::vector<PanelContent>& panels);

/// The whole figure as a file of this kind: ".svg", ".pdf" or ".png".
std::string figure_file(const FigureSpec& figure, const std::string& extension);

}  // namespace amrtex
