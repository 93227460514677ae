#pragma once

#include <cstdint>
#include <string>

#include "fabric/wif.h"
#include "fabric/wif_file.h"

namespace weft::fabric {

// The parts of a WIF file that say what its threads look like; read_wif puts them together.

// Reads [COLOR PALETTE] and [COLOR TABLE] into draft.colours.
void read_colour_table(WifFile& file, WifDraft& draft);

// Reads colour, spacing and thickness of all threads of `side`, "WARP" or "WEFT", into `threads`,
// whose count is known. Adds the colours that the file gives thread by thread to draft.colours, and
// a stand-in for every colour that the table lacks.
void read_thread_looks(WifFile& file, const std::string& side, WifDraft& draft,
                       WifThreads& threads);

// The thread number, from 0, that a key of a per-thread section stands for. Programs that count
// from 0 are recognised by a key 0 and no key `count`.
class ThreadNumbering {
 public:
  ThreadNumbering(WifFile& file, const WifSection& section, std::uint32_t count);
  // At least count when the key names no thread.
  [[nodiscard]] std::uint32_t index(std::uint32_t key) const;

 private:
  std::uint32_t first_ = 1;
  std::uint32_t count_;
};

}  // namespace weft::fabric
