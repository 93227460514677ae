#include "core/version.h"

namespace weft::core {

const char* version() { return WEFT_VERSION; }

}  // namespace weft::core
