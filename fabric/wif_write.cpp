#include "fabric/wif_write.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <vector>

namespace weft::fabric {
namespace {

// One line of plain characters.
std::string plain(const std::string& text) {
  std::string result;
  for (const char c : text.substr(0, 200)) {
    result += c >= 0x20 && c < 0x7f ? c : '?';
  }
  return result;
}

std::string centimetres(double mm) {
  std::array<char, 32> digits{};
  (void)std::snprintf(digits.data(), digits.size(), "%.6g", mm / 10);
  return digits.data();
}

std::string side_text(const char* name, const WifThreads& threads) {
  std::string text = std::string("\n[") + name + "]\nThreads=" + std::to_string(threads.count) +
                     "\nUnits=Centimeters\n";
  if (threads.spacing_mm > 0) {
    text += "Spacing=" + centimetres(threads.spacing_mm) + "\n";
  }
  if (threads.thickness_mm > 0) {
    text += "Thickness=" + centimetres(threads.thickness_mm) + "\n";
  }
  text += std::string("\n[") + name + " COLORS]\n";
  for (std::uint32_t i = 0; i < threads.count; ++i) {
    text += std::to_string(i + 1) + "=" + std::to_string(threads.colours[i]) + "\n";
  }
  return text;
}

}  // namespace

std::string write_wif(const WifDraft& draft) {
  // Ends with equal columns share a shaft, numbered as they come.
  std::map<std::string, std::uint32_t> shafts;
  std::vector<std::uint32_t> threading(draft.warp.count);
  std::vector<std::string> columns;
  for (std::uint32_t end = 0; end < draft.warp.count; ++end) {
    std::string column(draft.weft.count, '0');
    for (std::uint32_t pick = 0; pick < draft.weft.count; ++pick) {
      column[pick] = draft.up[std::size_t{pick} * draft.warp.count + end] != 0 ? '1' : '0';
    }
    const auto [found, fresh] =
        shafts.try_emplace(column, static_cast<std::uint32_t>(shafts.size() + 1));
    if (fresh) {
      columns.push_back(column);
    }
    threading[end] = found->second;
  }
  std::string text =
      "[WIF]\nVersion=1.1\nDate=April 20, 1997\nDevelopers=wif@mhsoft.com\nSource Program=weft\n"
      "\n[CONTENTS]\nCOLOR PALETTE=true\nTEXT=true\nWEAVING=true\nWARP=true\nWEFT=true\n"
      "COLOR TABLE=true\nTHREADING=true\nLIFTPLAN=true\nWARP COLORS=true\nWEFT COLORS=true\n";
  text += "\n[TEXT]\nTitle=" + plain(draft.title) + "\n";
  text += "\n[WEAVING]\nShafts=" + std::to_string(columns.size()) + "\nTreadles=0\n" +
          "Rising Shed=true\n";
  text += side_text("WARP", draft.warp) + side_text("WEFT", draft.weft);
  text += "\n[COLOR PALETTE]\nEntries=" + std::to_string(draft.colours.size()) +
          "\nForm=RGB\nRange=0,255\n\n[COLOR TABLE]\n";
  for (const auto& [number, colour] : draft.colours) {
    text += std::to_string(number) + "=";
    for (std::size_t c = 0; c < 3; ++c) {
      text.append(c == 0 ? "" : ",").append(std::to_string(std::lround(255 * colour[c])));
    }
    text += "\n";
  }
  text += "\n[THREADING]\n";
  for (std::uint32_t end = 0; end < draft.warp.count; ++end) {
    text += std::to_string(end + 1) + "=" + std::to_string(threading[end]) + "\n";
  }
  text += "\n[LIFTPLAN]\n";
  for (std::uint32_t pick = 0; pick < draft.weft.count; ++pick) {
    text += std::to_string(pick + 1) + "=";
    bool first = true;
    for (std::size_t shaft = 0; shaft < columns.size(); ++shaft) {
      if (columns[shaft][pick] == '1') {
        text.append(first ? "" : ",").append(std::to_string(shaft + 1));
        first = false;
      }
    }
    text += first ? "0\n" : "\n";
  }
  return text;
}

}  // namespace weft::fabric
