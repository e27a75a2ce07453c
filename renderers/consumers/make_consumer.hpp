// The consumer that a scene asks for: the one place that knows all of them.
#pragma once

#include <memory>

#include "renderers/consumers/consumer.hpp"
#include "renderers/gpu/structure.hpp"
#include "renderers/scene/scene.hpp"
#include "structures/mesh/domain_geometry.hpp"

namespace amrtex {

/// Throws UnsupportedError naming consumer and reason where it cannot draw the scene or the field. The structure and the context
/// must outlive it.
std::unique_ptr<Consumer> make_consumer(Context& context, const DomainGeometry& geometry, const Structure& structure,
                                        const Scene& scene);

}  // namespace amrtex
