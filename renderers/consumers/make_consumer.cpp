#include "renderers/consumers/make_consumer.hpp"

#include "renderers/consumers/box_consumer.hpp"
#include "renderers/consumers/raycaster.hpp"

namespace amrtex {

std::unique_ptr<Consumer> make_consumer(Context& context, const DomainGeometry& geometry, const Structure& structure,
                                        const Scene& scene) {
  if (scene.settings.consumer == ConsumerKind::raycast) return std::make_unique<Raycaster>(context, geometry, structure, scene);
  return std::make_unique<BoxConsumer>(context, geometry, structure, scene);
}

}  // namespace amrtex
