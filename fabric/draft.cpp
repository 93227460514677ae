#include "fabric/draft.h"

#include <algorithm>
#include <cstddef>
#include <functional>
#include <map>
#include <numeric>
#include <utility>

#include "core/error.h"
#include "fabric/wif.h"

namespace weft::fabric {
namespace {

[[noreturn]] void refuse(const std::string& message) {
  throw core::Error(core::Code::kInvalidArgument, message);
}

// A draft before its yarns are known: threads have colours.
struct ColouredDraft {
  std::uint32_t ends = 0;
  std::uint32_t picks = 0;
  std::vector<std::uint8_t> up;
  std::vector<std::uint32_t> end_colours;
  std::vector<std::uint32_t> pick_colours;
};

std::vector<std::uint32_t> cycled(const google::protobuf::RepeatedField<std::uint32_t>& given,
                                  std::uint32_t count, std::uint32_t otherwise) {
  std::vector<std::uint32_t> colours(count, otherwise);
  if (!given.empty()) {
    for (std::uint32_t i = 0; i < count; ++i) {
      colours[i] = given.Get(static_cast<int>(i % static_cast<std::uint32_t>(given.size())));
    }
  }
  return colours;
}

// The least number of threads after which the cycle of colours and the rows both start again.
std::uint32_t repeat_of_cycle(std::uint32_t threads, int cycle, const char* kind) {
  if (cycle <= 0) {
    return threads;
  }
  const std::uint64_t both = std::lcm<std::uint64_t>(threads, static_cast<std::uint64_t>(cycle));
  if (both > kMaxThreads) {
    refuse("a matrix of " + std::to_string(threads) + " " + kind + "s and a cycle of " +
           std::to_string(cycle) + " " + kind + " colours repeat only after " +
           std::to_string(both) + " " + kind + "s; at most " + std::to_string(kMaxThreads) +
           " are possible");
  }
  return static_cast<std::uint32_t>(both);
}

ColouredDraft from_matrix(const v1::Matrix& matrix) {
  if (matrix.rows().empty() || matrix.rows(0).empty()) {
    refuse("the matrix has no rows; give one string per pick, such as \"X.X.\"");
  }
  const auto columns = static_cast<std::uint32_t>(matrix.rows(0).size());
  const auto rows = static_cast<std::uint32_t>(matrix.rows_size());
  if (matrix.rows(0).size() > kMaxThreads || rows > kMaxThreads) {
    refuse("the matrix has more than " + std::to_string(kMaxThreads) + " threads in one direction");
  }
  ColouredDraft draft;
  draft.ends = repeat_of_cycle(columns, matrix.end_colours_size(), "end");
  draft.picks = repeat_of_cycle(rows, matrix.pick_colours_size(), "pick");
  const std::uint64_t crossings = std::uint64_t{draft.ends} * draft.picks;
  if (crossings > kMaxCrossings) {
    refuse("the draft repeats after " + std::to_string(draft.ends) + " ends and " +
           std::to_string(draft.picks) + " picks; at most " + std::to_string(kMaxCrossings) +
           " crossings are possible");
  }
  draft.up.resize(static_cast<std::size_t>(crossings));
  for (std::uint32_t pick = 0; pick < draft.picks; ++pick) {
    const std::string& row = matrix.rows(static_cast<int>(pick % rows));
    if (row.size() != columns) {
      refuse("row " + std::to_string(pick + 1) + " of the matrix has " +
             std::to_string(row.size()) + " ends, the first has " + std::to_string(columns) +
             "; all rows need the same length");
    }
    for (std::uint32_t end = 0; end < draft.ends; ++end) {
      const char c = row[end % columns];
      if (c != 'X' && c != '1' && c != '.' && c != '0') {
        refuse("row " + std::to_string(pick + 1) + " of the matrix has the character '" +
               std::string(1, c) + "'; use X or 1 where the warp is on top, . or 0 elsewhere");
      }
      draft.up[static_cast<std::size_t>(pick) * draft.ends + end] = c == 'X' || c == '1' ? 1 : 0;
    }
  }
  draft.end_colours = cycled(matrix.end_colours(), draft.ends, 1);
  draft.pick_colours = cycled(matrix.pick_colours(), draft.picks, 2);
  return draft;
}

struct Range {
  std::uint32_t first = 0;
  std::uint32_t count = 0;
};

Range crop_range(std::uint32_t first, std::uint32_t count, std::uint32_t threads,
                 const char* kind) {
  const std::uint32_t from = first == 0 ? 0 : first - 1;
  if (from >= threads) {
    refuse("the crop starts at " + std::string(kind) + " " + std::to_string(first) +
           ", the draft has " + std::to_string(threads));
  }
  const std::uint32_t rest = threads - from;
  if (count > rest) {
    refuse("the crop wants " + std::to_string(count) + " " + kind + "s from " + kind + " " +
           std::to_string(from + 1) + " on, the draft has only " + std::to_string(rest) + " there");
  }
  return {from, count == 0 ? rest : count};
}

ColouredDraft cropped(const ColouredDraft& draft, const v1::Crop& crop) {
  const Range ends = crop_range(crop.first_end(), crop.ends(), draft.ends, "end");
  const Range picks = crop_range(crop.first_pick(), crop.picks(), draft.picks, "pick");
  ColouredDraft part;
  part.ends = ends.count;
  part.picks = picks.count;
  for (std::uint32_t pick = 0; pick < picks.count; ++pick) {
    const auto row = draft.up.begin() +
                     static_cast<std::ptrdiff_t>(std::size_t{picks.first + pick} * draft.ends);
    part.up.insert(part.up.end(), row + ends.first, row + ends.first + ends.count);
    part.pick_colours.push_back(draft.pick_colours[picks.first + pick]);
  }
  part.end_colours.assign(draft.end_colours.begin() + ends.first,
                          draft.end_colours.begin() + ends.first + ends.count);
  return part;
}

std::vector<std::string> yarns_of(const std::vector<std::uint32_t>& colours,
                                  const std::map<std::uint32_t, std::string>& by_colour,
                                  const std::string& otherwise, const char* kind) {
  std::vector<std::string> yarns;
  yarns.reserve(colours.size());
  for (const std::uint32_t colour : colours) {
    const auto found = by_colour.find(colour);
    yarns.push_back(found != by_colour.end() ? found->second : otherwise);
    if (yarns.back().empty()) {
      refuse(std::string(kind) + " " + std::to_string(yarns.size()) + " of colour " +
             std::to_string(colour) + " has no yarn; set weave." +
             (kind[0] == 'e' ? "warp" : "weft") + "_yarn or a colour_yarns entry");
    }
  }
  return yarns;
}

// The smallest divisor p of n for which element i equals element i + p, for every i.
std::uint32_t period(std::uint32_t n,
                     const std::function<bool(std::uint32_t, std::uint32_t)>& equal) {
  for (std::uint32_t p = 1; p < n; ++p) {
    if (n % p != 0) {
      continue;
    }
    bool repeats = true;
    for (std::uint32_t i = 0; repeats && i + p < n; ++i) {
      repeats = equal(i, i + p);
    }
    if (repeats) {
      return p;
    }
  }
  return n;
}

}  // namespace

Draft minimal_repeat(const Draft& draft) {
  const auto row = [&](std::uint32_t pick) {
    return draft.up.begin() + static_cast<std::ptrdiff_t>(std::size_t{pick} * draft.ends);
  };
  const std::uint32_t picks = period(draft.picks, [&](std::uint32_t a, std::uint32_t b) {
    return draft.pick_yarns[a] == draft.pick_yarns[b] &&
           std::equal(row(a), row(a) + draft.ends, row(b));
  });
  const std::uint32_t ends = period(draft.ends, [&](std::uint32_t a, std::uint32_t b) {
    bool same = draft.end_yarns[a] == draft.end_yarns[b];
    for (std::uint32_t pick = 0; same && pick < picks; ++pick) {
      same = draft.warp_up(pick, a) == draft.warp_up(pick, b);
    }
    return same;
  });
  Draft repeat;
  repeat.ends = ends;
  repeat.picks = picks;
  for (std::uint32_t pick = 0; pick < picks; ++pick) {
    repeat.up.insert(repeat.up.end(), row(pick), row(pick) + ends);
  }
  repeat.end_yarns.assign(draft.end_yarns.begin(), draft.end_yarns.begin() + ends);
  repeat.pick_yarns.assign(draft.pick_yarns.begin(), draft.pick_yarns.begin() + picks);
  return repeat;
}

Draft draft_of(const v1::Weave& weave) {
  ColouredDraft coloured;
  if (weave.has_matrix()) {
    coloured = from_matrix(weave.matrix());
  } else if (weave.has_wif_text()) {
    WifDraft wif = read_wif(weave.wif_text(), "the draft");
    coloured = {wif.warp.count, wif.weft.count, std::move(wif.up), std::move(wif.warp.colours),
                std::move(wif.weft.colours)};
  } else if (weave.has_wif_file()) {
    refuse("the draft is still a file, " + weave.wif_file() + "; load the description from a file");
  } else {
    refuse("the weave has no draft; give a matrix or a wif_file");
  }
  coloured = cropped(coloured, weave.crop());
  std::map<std::uint32_t, std::string> warp;
  std::map<std::uint32_t, std::string> weft;
  for (const v1::ColourYarn& entry : weave.colour_yarns()) {
    if (!entry.warp_yarn().empty()) {
      warp[entry.colour()] = entry.warp_yarn();
    }
    if (!entry.weft_yarn().empty()) {
      weft[entry.colour()] = entry.weft_yarn();
    }
  }
  Draft draft;
  draft.ends = coloured.ends;
  draft.picks = coloured.picks;
  draft.up = std::move(coloured.up);
  draft.end_yarns = yarns_of(coloured.end_colours, warp, weave.warp_yarn(), "end");
  draft.pick_yarns = yarns_of(coloured.pick_colours, weft, weave.weft_yarn(), "pick");
  return minimal_repeat(draft);
}

}  // namespace weft::fabric
