#include "coordinator/versions/colourway_arrival.h"

#include <algorithm>
#include <system_error>
#include <utility>

#include "coordinator/versions/colourway_check.h"
#include "core/error.h"
#include "proto/limits.h"
#include "proto/names.h"
#include "storage/recolouring.h"

namespace weft::coordinator {

namespace {

std::string text_of(const VersionRecord& version) {
  return version.fabric + "@" + std::to_string(version.number);
}

// A colourway may have floats where its base has halves, and up to four tables of fibres more.
std::uint64_t limit_for(const VersionRecord& base) {
  constexpr std::uint64_t kTablesBytes = std::uint64_t{4} << 20;
  return std::min(v1::kColourwayLimitBytes, 2 * base.size_bytes + kTablesBytes);
}

ColourwayBase read_base(Catalogue& catalogue, const VersionRecord& version) {
  ColourwayBase base{text_of(version), version.content_digest, {}};
  catalogue.with_files({version}, [&](const std::vector<std::filesystem::path>& files) {
    base.contents = storage::read_recolourable(files[0]);
  });
  return base;
}

}  // namespace

ColourwayArrival::ColourwayArrival(Catalogue& catalogue, ColourwayClaim claim)
    : catalogue_(catalogue), claim_(std::move(claim)), base_(catalogue.find(claim_.base)) {
  if (claim_.base != text_of(base_)) {
    throw core::Error(core::Code::kInvalidArgument,
                      "base is '" + claim_.base +
                          "', which may mean another version later; it is " + text_of(base_) +
                          " now");
  }
  if (!v1::is_fabric_name(claim_.fabric)) {
    throw core::Error(core::Code::kInvalidArgument,
                      "'" + claim_.fabric + "' cannot be a fabric's name");
  }
  if (const std::uint64_t limit = limit_for(base_); claim_.size_bytes > limit) {
    throw core::Error(core::Code::kResourceExhausted, "colourway_bytes_limit: the colourway has " +
                                                          std::to_string(claim_.size_bytes) +
                                                          " bytes; one of " + text_of(base_) +
                                                          " has at most " + std::to_string(limit));
  }
  path_ = catalogue_.new_arrival();
  file_.open(path_, std::ios::binary | std::ios::trunc);
}

ColourwayArrival::~ColourwayArrival() {
  std::error_code ignored;  // what stays is wiped by the next start
  std::filesystem::remove(path_, ignored);
  std::filesystem::remove(path_.string() + ".new", ignored);
}

void ColourwayArrival::add(std::string_view bytes) {
  if (bytes.size() > claim_.size_bytes - come_bytes_) {
    throw core::Error(core::Code::kDataLoss, "more bytes of the colourway came than the " +
                                                 std::to_string(claim_.size_bytes) +
                                                 " that were announced; nothing was published");
  }
  come_bytes_ += bytes.size();
  file_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  check_written();
}

void ColourwayArrival::check_written() const {
  if (!file_) {
    throw core::Error(core::Code::kResourceExhausted,
                      "the coordinator cannot keep the colourway: writing " + path_.string() +
                          " failed; make room on its disk, and try again");
  }
}

VersionRecord ColourwayArrival::publish() {
  file_.close();
  check_written();
  if (come_bytes_ != claim_.size_bytes || storage::content_digest(path_) != claim_.content_digest) {
    throw core::Error(core::Code::kDataLoss,
                      std::to_string(come_bytes_) + " of the colourway's " +
                          std::to_string(claim_.size_bytes) +
                          " bytes came, or others than were announced; nothing was published, "
                          "send it again");
  }
  const storage::RecolourableDatabase colourway = storage::read_recolourable(path_);
  check_colourway(colourway, claim_.fabric, read_base(catalogue_, base_));

  Publication publication;
  publication.fabric = claim_.fabric;
  publication.file = path_.string() + ".new";
  publication.content_digest =
      storage::write_database(colourway.database, colourway.recolouring, publication.file);
  publication.comment = claim_.order.comment;
  publication.now_ms = claim_.order.now_ms;
  publication.user = claim_.order.user;
  publication.carried_over_from = text_of(base_);
  publication.request_id = claim_.order.request_id;
  catalogue_.prepare(publication);
  return catalogue_.publish(publication);
}

}  // namespace weft::coordinator
