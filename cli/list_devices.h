#pragma once

namespace weft::cli {

// Prints the devices that can draw, the one that is taken by default first. Throws core::Error when
// there is none.
void list_devices(bool wants_json);

}  // namespace weft::cli
