#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "coordinator/versions/catalogue.h"
#include "core/digest.h"

namespace weft::coordinator {

// What a maker of a colourway says of it.
struct ColourwayClaim {
  CatalogueOrder order;
  std::string fabric;  // which it becomes a version of
  std::string base;    // "silk@3"
  core::Digest content_digest;
  std::uint64_t size_bytes = 0;
};

// A colourway on its way into a catalogue: comes in parts, is checked, and becomes a version. Its
// files are gone when this is. One thread.
class ColourwayArrival {
 public:
  // Throws core::Error as Catalogue::find, kInvalidArgument where the claim breaks a rule,
  // kResourceExhausted where it is larger than a colourway of its base can be. `catalogue` must
  // outlive this.
  ColourwayArrival(Catalogue& catalogue, ColourwayClaim claim);
  ~ColourwayArrival();
  ColourwayArrival(const ColourwayArrival&) = delete;
  ColourwayArrival& operator=(const ColourwayArrival&) = delete;
  ColourwayArrival(ColourwayArrival&&) = delete;
  ColourwayArrival& operator=(ColourwayArrival&&) = delete;

  // The next bytes. Throws core::Error: kDataLoss when they are more than were claimed,
  // kResourceExhausted when they cannot be written.
  void add(std::string_view bytes);

  // Parses what came, in the sandbox, holds it against its base (check_colourway), and publishes
  // it, written anew, so that the catalogue has files of this process' making only. Throws
  // core::Error: kDataLoss when the bytes are not those that were claimed, and what both throw.
  VersionRecord publish();

 private:
  void check_written() const;

  Catalogue& catalogue_;
  ColourwayClaim claim_;
  VersionRecord base_;
  std::filesystem::path path_;
  std::ofstream file_;
  std::uint64_t come_bytes_ = 0;
};

}  // namespace weft::coordinator
