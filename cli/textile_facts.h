#pragma once

#include <string>
#include <vector>

#include "fabric/draft.h"
#include "fabric/tile.h"
#include "proto/weft/v1/fabric.pb.h"

namespace weft::cli {

// What the textile trade calls a fabric, in the words of U3M 1.1, whose lists these are: a word of
// the list, or "other" with a name of our own.
struct TradeWord {
  std::string type;
  std::string name;  // empty but for "other"
};

// "Woven", "Knit", or unknown for fibres given one by one.
[[nodiscard]] TradeWord material_type(const v1::FabricDescription& description);

// "Plain weave", "Twill - right hand (Z)", "Twill - left hand (S)", "Satin", or how many ends and
// picks the weave repeats after; unknown for what is not woven. Yarns are not looked at.
[[nodiscard]] TradeWord construction(const v1::FabricDescription& description);

// The same of a draft: each pick's row is the one before it moved by one step. A satin binds every
// end once and no two neighbours next to each other.
[[nodiscard]] TradeWord weave_word(const fabric::Draft& draft);

struct Fibre {
  TradeWord word;
  double share = 0;  // of all the fibres' volume
};

// The fibres by volume, the most first; shares sum to 1. A material whose name has the word of a
// fibre of U3M's list is that fibre.
[[nodiscard]] std::vector<Fibre> composition(const fabric::Tile& tile);

}  // namespace weft::cli
