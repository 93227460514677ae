#include "fabric/read_draft.h"

#include <algorithm>

#include "fabric/dtx.h"
#include "fabric/wpo.h"

namespace weft::fabric {
namespace {

bool ends_in(const std::string& name, std::string_view extension) {
  return name.size() >= extension.size() &&
         std::equal(extension.rbegin(), extension.rend(), name.rbegin(), [](char a, char b) {
           return a == (b >= 'A' && b <= 'Z' ? static_cast<char>(b - 'A' + 'a') : b);
         });
}

}  // namespace

DraftFormat draft_format(std::string_view bytes, const std::string& name) {
  if (ends_in(name, ".wif")) {
    return DraftFormat::kWif;
  }
  if (ends_in(name, ".dtx") || (looks_like_dtx(bytes) && !ends_in(name, ".wpo"))) {
    return DraftFormat::kDtx;
  }
  return ends_in(name, ".wpo") || looks_like_wpo(bytes) ? DraftFormat::kWpo : DraftFormat::kWif;
}

WifDraft read_draft(std::string_view bytes, const std::string& name) {
  switch (draft_format(bytes, name)) {
    case DraftFormat::kDtx:
      return read_dtx(bytes, name);
    case DraftFormat::kWpo:
      return read_wpo(bytes, name);
    case DraftFormat::kWif:
      break;
  }
  return read_wif(bytes, name);
}

}  // namespace weft::fabric
