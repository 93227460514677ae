#pragma once

namespace weft::cli {

// Prints the devices that can draw beside the CPU, GPUs first, and whether there is a GPU at all.
// Throws core::Error when there is none.
void list_devices(bool wants_json);

}  // namespace weft::cli
