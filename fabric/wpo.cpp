#include "fabric/wpo.h"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "core/error.h"
#include "fabric/draft.h"
#include "fabric/draft_text.h"
#include "fabric/shed.h"
#include "fabric/wif_file.h"

namespace weft::fabric {
namespace {

constexpr std::uint32_t kSign = 123;
constexpr std::uint32_t kLastVersion = 7;
constexpr std::uint32_t kFineColoursVersion = 4;
constexpr double kInchMm = 25.4;

enum class Kind : std::uint32_t { kLiftPlan = 100, kOneTreadle = 101, kSeveralTreadles = 102 };

class Bytes {
 public:
  Bytes(std::string_view bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  [[noreturn]] void fail(const std::string& what) const {
    throw core::Error(core::Code::kInvalidArgument,
                      name_ + ": byte " + std::to_string(at_) + ": " + what);
  }
  std::uint32_t one(const char* what) {
    need(1, what);
    return static_cast<unsigned char>(bytes_[at_++]);
  }
  std::uint32_t two(const char* what) {
    need(2, what);
    const std::uint32_t high = one(what);
    return high << 8 | one(what);
  }
  void skip(std::size_t count, const char* what) {
    need(count, what);
    at_ += count;
  }
  // Room for `count` more bytes, or an end with a message.
  void need(std::size_t count, const char* what) const {
    if (count > bytes_.size() - at_) {
      fail(std::string("the file ends within ") + what + "; it was cut short, get it again");
    }
  }

 private:
  std::string_view bytes_;
  const std::string& name_;
  std::size_t at_ = 0;
};

std::uint32_t count_of(Bytes& bytes, const char* what) {
  const std::uint32_t count = bytes.two(what);
  if (count > kMaxThreads) {
    bytes.fail(std::string(what) + " has " + std::to_string(count) + " entries; at most " +
               std::to_string(kMaxThreads) + " are possible");
  }
  return count;
}

std::vector<std::uint32_t> numbers(Bytes& bytes, const char* what) {
  std::vector<std::uint32_t> result(count_of(bytes, what));
  bytes.need(result.size(), what);
  for (std::uint32_t& number : result) {
    number = bytes.one(what);
  }
  return result;
}

// One number for each thread or pick, 0 for none, at most `limit`.
NumberLists single_numbers(Bytes& bytes, const char* what, std::uint32_t limit) {
  NumberLists lists;
  for (const std::uint32_t number : numbers(bytes, what)) {
    if (number > limit) {
      bytes.fail(std::string(what) + " names number " + std::to_string(number) + ", there are " +
                 std::to_string(limit));
    }
    lists.emplace_back(number == 0 ? 0 : 1, number);
  }
  return lists;
}

// `rows` rows of `width` bits as the numbers of their ones.
NumberLists bit_rows(Bytes& bytes, const char* what, std::uint32_t rows, std::uint32_t width) {
  const std::uint32_t row_bytes = (width + 7) / 8;
  bytes.need(std::size_t{rows} * row_bytes, what);
  NumberLists lists(rows);
  for (std::vector<std::uint32_t>& list : lists) {
    std::uint32_t bits = 0;
    for (std::uint32_t place = 0; place < 8 * row_bytes; ++place) {
      bits = place % 8 == 0 ? bytes.one(what) : bits >> 1U;
      if ((bits & 1U) == 0) {
        continue;
      }
      if (place >= width) {
        bytes.fail(std::string(what) + " names number " + std::to_string(place + 1) +
                   ", there are " + std::to_string(width));
      }
      list.push_back(place + 1);
    }
  }
  return lists;
}

struct Header {
  std::uint32_t version = 0;
  Kind kind = Kind::kLiftPlan;
  std::uint32_t shafts = 0;
  std::uint32_t treadles = 0;
  bool rising = true;
  std::uint32_t ends_per_inch = 0;
  std::uint32_t picks_per_inch = 0;
};

Header read_header(Bytes& bytes) {
  constexpr const char* kWhat = "its header";
  if (bytes.one(kWhat) != kSign) {
    bytes.fail("the file does not begin as a WeavePoint draft does; is it one?");
  }
  Header header;
  header.version = bytes.one(kWhat);
  const std::uint32_t kind = bytes.one(kWhat);
  if (kind < static_cast<std::uint32_t>(Kind::kLiftPlan) ||
      kind > static_cast<std::uint32_t>(Kind::kSeveralTreadles)) {
    bytes.fail("the draft is of kind " + std::to_string(kind) +
               "; only 100 (lift plan), 101 (one treadle a pick) and 102 (several) are known");
  }
  header.kind = static_cast<Kind>(kind);
  bytes.skip(1, kWhat);  // zoom
  header.shafts = bytes.one(kWhat);
  header.treadles = bytes.one(kWhat);
  bytes.skip(1, kWhat);
  header.rising = bytes.one(kWhat) == 0;
  bytes.skip(1, kWhat);
  header.ends_per_inch = bytes.one(kWhat);
  header.picks_per_inch = bytes.one(kWhat);
  bytes.skip(2, kWhat);
  bytes.skip(2 + 2 + 7, kWhat);  // the page's threads; unknown
  if (header.shafts == 0) {
    bytes.fail("the draft has no shafts");
  }
  return header;
}

NumberLists read_moved(Bytes& bytes, const Header& header) {
  if (header.kind == Kind::kLiftPlan) {
    const std::uint32_t picks = count_of(bytes, "the lift plan");
    return bit_rows(bytes, "the lift plan", picks, header.shafts);
  }
  if (header.treadles == 0) {
    bytes.fail("the draft has a tie-up, but no treadles");
  }
  const NumberLists tied = bit_rows(bytes, "the tie-up", header.treadles, header.shafts);
  if (header.kind == Kind::kOneTreadle) {
    return moved_by_treadles(single_numbers(bytes, "the treadling", header.treadles), tied);
  }
  const std::uint32_t picks = count_of(bytes, "the treadling");
  return moved_by_treadles(bit_rows(bytes, "the treadling", picks, header.treadles), tied);
}

void read_palette(Bytes& bytes, const Header& header, WifDraft& draft) {
  const std::uint32_t count = bytes.one("the colours");
  const double greatest = header.version >= kFineColoursVersion ? 255 : 63;
  for (std::uint32_t colour = 1; colour <= count; ++colour) {
    for (double& component : draft.colours[colour]) {
      component = std::min(1.0, bytes.one("the colours") / greatest);
    }
  }
  if (count == 0) {
    bytes.fail("the draft has no colours");
  }
}

// The colours of a side's threads: its first ones, for the page may have more.
void set_colours(const std::vector<std::uint32_t>& given, const char* side, WifDraft& draft,
                 WifThreads& threads) {
  const auto last = static_cast<std::uint32_t>(draft.colours.size());
  const auto used = std::min<std::size_t>(given.size(), threads.count);
  threads.colours.assign(threads.count, given.empty() ? 1 : std::min(given.back() + 1, last));
  std::size_t beyond = 0;
  for (std::size_t i = 0; i < used; ++i) {
    beyond += given[i] + 1 > last ? 1U : 0U;
    threads.colours[i] = std::min(given[i] + 1, last);
  }
  if (given.size() < threads.count) {
    draft.notes.push_back(std::string("the ") + side + " has " +
                          number_of(threads.count, "thread") + " and " +
                          number_of(given.size(), "colour") + "; the last one goes on");
  }
  if (beyond > 0) {
    draft.notes.push_back(number_of(beyond, "thread") + " of the " + side +
                          " have colours beyond the palette's " + std::to_string(last) +
                          "; its last one is taken");
  }
}

}  // namespace

WifDraft read_wpo(std::string_view text, const std::string& name) {
  if (text.size() > kMaxWifBytes) {
    throw core::Error(core::Code::kInvalidArgument,
                      name + ": the file has " + std::to_string(text.size()) +
                          " bytes; a draft has at most " + std::to_string(kMaxWifBytes));
  }
  Bytes bytes(text, name);
  const Header header = read_header(bytes);
  WifDraft draft;
  draft.source_program = "WeavePoint (file version " + std::to_string(header.version) + ")";
  if (header.version > kLastVersion) {
    draft.notes.push_back("the file is of version " + std::to_string(header.version) +
                          ", newer than is known; look at what was read");
  }
  Shed shed;
  shed.rising = header.rising;
  shed.threading = single_numbers(bytes, "the threading", header.shafts);
  const std::vector<std::uint32_t> warp = numbers(bytes, "the warp's colours");
  const std::vector<std::uint32_t> weft = numbers(bytes, "the weft's colours");
  shed.moved = read_moved(bytes, header);
  draft.warp.count = static_cast<std::uint32_t>(shed.threading.size());
  draft.weft.count = static_cast<std::uint32_t>(shed.moved.size());
  if (draft.warp.count == 0 || draft.weft.count == 0 ||
      std::uint64_t{draft.warp.count} * draft.weft.count > kMaxCrossings) {
    bytes.fail("the draft has " + std::to_string(draft.warp.count) + " ends and " +
               std::to_string(draft.weft.count) + " picks; 1 to " + std::to_string(kMaxCrossings) +
               " crossings are possible");
  }
  bytes.skip(66, "its translation grids");
  read_palette(bytes, header, draft);
  draw_down(shed, draft);
  set_colours(warp, "warp", draft, draft.warp);
  set_colours(weft, "weft", draft, draft.weft);
  draft.warp.spacing_mm = header.ends_per_inch > 0 ? kInchMm / header.ends_per_inch : 0;
  draft.weft.spacing_mm = header.picks_per_inch > 0 ? kInchMm / header.picks_per_inch : 0;
  draft.notes.emplace_back(
      "spacing and thickness of single threads are not read from WeavePoint files; the sett is "
      "theirs");
  if (std::optional<std::string> note = note_on_unbound(draft)) {
    draft.notes.push_back(std::move(*note));
  }
  return draft;
}

bool looks_like_wpo(std::string_view bytes) {
  return bytes.size() > 2 && static_cast<unsigned char>(bytes[0]) == kSign &&
         static_cast<unsigned char>(bytes[1]) < 32 && static_cast<unsigned char>(bytes[2]) >= 100 &&
         static_cast<unsigned char>(bytes[2]) <= 102;
}

}  // namespace weft::fabric
