#include "fabric/layout.h"

#include "core/error.h"
#include "fabric/knit_pattern.h"
#include "fabric/weave_layout.h"

namespace weft::fabric {

YarnLayout lay_out(const v1::FabricDescription& description) {
  if (description.has_weave()) {
    return lay_out_weave(description);
  }
  if (description.has_yarn_curves()) {
    return lay_out_curves(description);
  }
  throw core::Error(core::Code::kInvalidArgument,
                    "the description has no structure; give a weave, yarn curves or explicit "
                    "fibres");
}

}  // namespace weft::fabric
