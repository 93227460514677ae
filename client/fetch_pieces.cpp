#include "client/fetch_pieces.h"

#include <algorithm>
#include <set>
#include <thread>

#include "core/error.h"
#include "proto/limits.h"

namespace weft::client {

namespace {

constexpr int kTriesWithoutProgress = 5;
constexpr auto kPiecesInACall = static_cast<std::size_t>(v1::kPiecesLimit);
constexpr std::chrono::milliseconds kFirstWait{250};
constexpr std::uint64_t kSlowestBytesPerSecond = 100'000;
constexpr std::chrono::seconds kStreamAllowance{60};

// One stream of pieces, in the order in which they were asked for.
class PieceStream {
 public:
  PieceStream(Coordinator& coordinator, std::vector<storage::Piece> wanted)
      : wanted_(std::move(wanted)) {
    v1::ReadPiecesRequest request;
    std::uint64_t bytes = 0;
    for (const storage::Piece& piece : wanted_) {
      request.add_digests(piece.digest.binary());
      bytes += piece.size_bytes;
    }
    set_deadline(context_, bytes);
    reader_ = coordinator.catalogue().ReadPieces(&context_, request);
  }
  ~PieceStream() {
    if (!is_finished_) {
      (void)stop();
    }
  }
  PieceStream(const PieceStream&) = delete;
  PieceStream& operator=(const PieceStream&) = delete;
  PieceStream(PieceStream&&) = delete;
  PieceStream& operator=(PieceStream&&) = delete;

  [[nodiscard]] bool brings(const storage::Piece& piece) const {
    return next_ < wanted_.size() && wanted_[next_].digest == piece.digest;
  }
  // The bytes of the next piece; nothing when the stream broke off. Throws core::Error(kDataLoss)
  // when they are others.
  std::optional<std::string> next() {
    const storage::Piece& piece = wanted_[next_];
    v1::ReadPiecesResponse response;
    while (come_.size() < piece.size_bytes && reader_->Read(&response)) {
      come_ += response.data();
    }
    if (come_.size() < piece.size_bytes) {
      is_broken_off_ = true;
      return std::nullopt;
    }
    std::string bytes = come_.substr(0, piece.size_bytes);
    come_.erase(0, piece.size_bytes);
    if (core::digest_of(bytes) != piece.digest) {
      throw core::Error(core::Code::kDataLoss, "the piece " + piece.digest.hex().substr(0, 12) +
                                                   " did not arrive as it was stored; fetch again");
    }
    ++next_;
    return bytes;
  }
  // Why it broke off; OK when it did not, and is not needed any more.
  grpc::Status finish() {
    if (is_broken_off_) {
      is_finished_ = true;
      return reader_->Finish();
    }
    (void)stop();
    return grpc::Status::OK;
  }

 private:
  grpc::Status stop() {
    is_finished_ = true;
    context_.TryCancel();
    return reader_->Finish();
  }

  std::vector<storage::Piece> wanted_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<v1::ReadPiecesResponse>> reader_;
  std::size_t next_ = 0;
  std::string come_;  // of the next piece, and what came behind it
  bool is_broken_off_ = false;
  bool is_finished_ = false;
};

}  // namespace

void set_deadline(grpc::ClientContext& context, std::uint64_t bytes) {
  Coordinator::set_deadline(
      context, kStreamAllowance + std::chrono::seconds(bytes / kSlowestBytesPerSecond));
}

void Patience::wait(const grpc::Status& status, bool has_progressed) {
  const bool is_worth_repeating = status.ok() || Coordinator::is_worth_repeating(status);
  if (has_progressed || wait_ == std::chrono::milliseconds(0)) {
    tries_left_ = kTriesWithoutProgress;
    wait_ = kFirstWait;
  }
  if (!is_worth_repeating || --tries_left_ == 0) {
    coordinator_.check(status, doing_);
    throw core::Error(core::Code::kDataLoss,
                      "cannot " + doing_ + ": the coordinator's answer ends too early");
  }
  std::this_thread::sleep_for(wait_);
  wait_ *= 2;
}

std::optional<std::vector<storage::Piece>> manifest_of(Coordinator& coordinator,
                                                       const v1::Version& version) {
  v1::GetManifestRequest request;
  request.set_reference(reference_text(version));
  grpc::ClientContext context;
  Coordinator::set_deadline(context, kStreamAllowance);
  v1::GetManifestResponse response;
  const grpc::Status status = coordinator.catalogue().GetManifest(&context, request, &response);
  if (status.error_code() == grpc::StatusCode::UNIMPLEMENTED) {
    return std::nullopt;
  }
  coordinator.check(status, "look up " + reference_text(version));
  std::vector<storage::Piece> pieces;
  std::uint64_t total_bytes = 0;
  for (const v1::Piece& message : response.pieces()) {
    const auto digest = core::Digest::from_binary(message.digest());
    total_bytes += message.size_bytes();
    if (!digest || message.size_bytes() == 0 || message.size_bytes() > storage::kPieceLimitBytes) {
      throw core::Error(core::Code::kDataLoss,
                        "the coordinator's pieces of " + reference_text(version) + " are damaged");
    }
    pieces.push_back({*digest, message.size_bytes()});
  }
  if (total_bytes != version.size_bytes()) {
    throw core::Error(core::Code::kDataLoss, "the coordinator's pieces of " +
                                                 reference_text(version) +
                                                 " are not as many bytes as the version has");
  }
  return pieces;
}

// A broken fetch leaves whole pieces and a part of one, which begins again.
void PieceFetch::keep_what_is_good(FetchOutcome& outcome) {
  const std::uint64_t size_bytes = part_.size_bytes();
  PieceIndex of_part;
  of_part.add_file(part_.path(), pieces_);
  std::uint64_t good_bytes = 0;
  for (; next_ < pieces_.size(); ++next_) {
    const storage::Piece& piece = pieces_[next_];
    if (good_bytes + piece.size_bytes > size_bytes || !of_part.take(piece)) {
      break;
    }
    here_.add_piece(part_.path(), good_bytes, piece);
    good_bytes += piece.size_bytes;
  }
  part_.shorten(good_bytes);
  outcome.bytes_kept = good_bytes;
}

void PieceFetch::add(const storage::Piece& piece, std::string_view bytes,
                     const FetchReport& report) {
  const std::uint64_t offset = part_.size_bytes();
  part_.append(bytes);
  here_.add_piece(part_.path(), offset, piece);
  ++next_;
  if (report) {
    report(offset + piece.size_bytes, version_.size_bytes());
  }
}

std::vector<storage::Piece> PieceFetch::next_missing() const {
  std::vector<storage::Piece> missing;
  std::set<core::Digest> asked;
  for (std::size_t i = next_; i < pieces_.size() && missing.size() < kPiecesInACall; ++i) {
    if (!here_.has(pieces_[i].digest) && asked.insert(pieces_[i].digest).second) {
      missing.push_back(pieces_[i]);
    }
  }
  return missing;
}

// Goes on until everything is there, or a stream ends: broken off, or because what was asked for
// has come.
grpc::Status PieceFetch::run_once(const FetchReport& report, FetchOutcome& outcome) {
  std::optional<PieceStream> stream;
  const std::vector<storage::Piece> missing = next_missing();
  if (!missing.empty()) {
    stream.emplace(coordinator_, missing);
  }
  while (next_ < pieces_.size()) {
    const storage::Piece& piece = pieces_[next_];
    if (stream && stream->brings(piece)) {
      const std::optional<std::string> bytes = stream->next();
      if (!bytes) {
        break;
      }
      outcome.bytes_fetched += piece.size_bytes;
      add(piece, *bytes, report);
      continue;
    }
    const std::optional<std::string> bytes = here_.take(piece);
    if (!bytes) {
      break;  // it has gone from here, or was not asked for yet
    }
    outcome.bytes_reused += piece.size_bytes;
    add(piece, *bytes, report);
  }
  return stream ? stream->finish() : grpc::Status::OK;
}

void PieceFetch::run(const FetchReport& report, FetchOutcome& outcome) {
  keep_what_is_good(outcome);
  Patience patience(coordinator_, "fetch " + reference_text(version_));
  while (next_ < pieces_.size()) {
    const std::size_t before = next_;
    const grpc::Status status = run_once(report, outcome);
    if (next_ < pieces_.size() && (!status.ok() || next_ == before)) {
      patience.wait(status, next_ > before);
    }
  }
}

}  // namespace weft::client
