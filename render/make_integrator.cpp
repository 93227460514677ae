#include "render/make_integrator.h"

#include "render/baselines/dual_integrator.h"
#include "render/baselines/prt_integrator.h"
#include "render/path_integrator.h"
#include "render/precomputed_integrator.h"

namespace weft::render {
namespace {

TermSource source_of(v1::TermSource source) {
  switch (source) {
    case v1::TERM_SOURCE_CELL:
      return TermSource::kCell;
    case v1::TERM_SOURCE_SEGMENT:
      return TermSource::kSegment;
    default:
      return TermSource::kDatabase;
  }
}

}  // namespace

Scattering scattering_of(const v1::Integration& integration) {
  switch (integration.scattering()) {
    case v1::SCATTERING_SINGLE_ONLY:
      return Scattering::kSingleOnly;
    case v1::SCATTERING_MULTIPLE_ONLY:
      return Scattering::kMultipleOnly;
    default:
      return Scattering::kAll;
  }
}

std::unique_ptr<Integrator> make_integrator(const v1::Integration& integration, const Scene& scene,
                                            bool wants_shadow) {
  if (integration.integrator() == v1::INTEGRATOR_PATH) {
    PathSettings settings;
    settings.local = integration.local();
    settings.max_scatterings = integration.max_scatterings();
    settings.scattering = scattering_of(integration);
    settings.wants_shadow = wants_shadow;
    return std::make_unique<PathIntegrator>(scene, settings);
  }
  if (integration.integrator() == v1::INTEGRATOR_DUAL) {
    return std::make_unique<DualIntegrator>(scene, integration.local(), scattering_of(integration));
  }
  if (integration.integrator() == v1::INTEGRATOR_PRT) {
    PrtSettings settings;
    settings.seed = integration.seed();
    return std::make_unique<PrtIntegrator>(scene, settings);
  }
  const TermSources sources{source_of(integration.single_from()),
                            source_of(integration.multiple_from())};
  auto precomputed = std::make_unique<PrecomputedIntegrator>(scene, scattering_of(integration),
                                                             wants_shadow, sources);
  if (integration.paper()) {
    precomputed->shade_by(kPaperSettings);
  }
  return precomputed;
}

bool draws_on_device(const v1::Integration& integration) {
  return integration.integrator() == v1::INTEGRATOR_PRECOMPUTED &&
         integration.target_error() == 0 &&
         source_of(integration.single_from()) == TermSource::kDatabase &&
         source_of(integration.multiple_from()) == TermSource::kDatabase;
}

bool reads_transfer(v1::Integrator integrator) {
  return integrator == v1::INTEGRATOR_PRECOMPUTED || integrator == v1::INTEGRATOR_PRT;
}

const std::map<std::string, v1::Integrator>& integrators_by_name() {
  static const std::map<std::string, v1::Integrator> names = {
      {"path", v1::INTEGRATOR_PATH},
      {"precomputed", v1::INTEGRATOR_PRECOMPUTED},
      {"dual", v1::INTEGRATOR_DUAL},
      {"prt", v1::INTEGRATOR_PRT}};
  return names;
}

}  // namespace weft::render
