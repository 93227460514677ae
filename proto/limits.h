#pragma once

#include <cstddef>
#include <cstdint>

// The limits that cluster.proto states, for both ends of a call.

namespace weft::v1 {

inline constexpr int kMessageLimitBytes = 64 << 20;
inline constexpr std::size_t kChunkLimitBytes = std::size_t{1} << 20;
inline constexpr std::size_t kBatchLimitBytes = std::size_t{4} << 20;
inline constexpr std::uint64_t kBlobLimitBytes = std::uint64_t{1} << 30;
inline constexpr std::uint64_t kColourwayLimitBytes = std::uint64_t{4} << 30;
inline constexpr int kCompletionLimit = 1024;
inline constexpr std::uint32_t kFreeAttemptsLimit = 64;
inline constexpr std::uint32_t kThreadsLimit = 4096;
inline constexpr std::uint32_t kWaitLimitMs = 30'000;
inline constexpr std::size_t kIdLimit = 64;
inline constexpr std::size_t kNameLimitBytes = 128;
inline constexpr std::size_t kErrorTextLimitBytes = 4096;
inline constexpr std::size_t kCommentLimitBytes = 1024;
inline constexpr std::uint32_t kListLimit = 1000;
inline constexpr std::size_t kLabelsLimit = 16;
inline constexpr std::size_t kScenesLimit = 8;
inline constexpr std::size_t kLastLineLimitBytes = 256;
inline constexpr std::size_t kLogChunkLimitBytes = std::size_t{64} << 10;
inline constexpr std::uint64_t kAttemptLogLimitBytes = std::uint64_t{256} << 10;
inline constexpr int kPiecesLimit = 4096;
inline constexpr std::uint64_t kGraceLeastSeconds = 60;
inline constexpr std::uint64_t kGraceLimitSeconds = std::uint64_t{10} * 365 * 24 * 3600;

// Of connections. Each end asks the other whether it is there when nothing came for a while; a
// server closes a connection that asks more often than kFastestPingMs.
inline constexpr int kKeepaliveMs = 20'000;
inline constexpr int kKeepaliveTimeoutMs = 10'000;
inline constexpr int kFastestPingMs = 10'000;
inline constexpr int kStreamsPerConnectionLimit = 1024;

// Calls that run for as long as their callers like, each with a thread and a chunk of memory.
inline constexpr int kWatchersLimit = 64;
inline constexpr int kWatchersPerConnectionLimit = 16;
inline constexpr int kLogReadersLimit = 32;
inline constexpr int kLogReadersPerConnectionLimit = 8;
inline constexpr int kFetchesLimit = 64;  // FetchVersion and ReadPieces
inline constexpr int kFetchesPerConnectionLimit = 16;
inline constexpr int kColourwaysLimit = 4;  // PublishColourway
inline constexpr int kColourwaysPerConnectionLimit = 2;
inline constexpr int kBlobReadsLimit = 128;
inline constexpr int kBlobReadsPerConnectionLimit = 64;
inline constexpr int kUploadsLimit = 128;
inline constexpr int kUploadsPerConnectionLimit = 64;
inline constexpr std::uint64_t kServerMemoryLimitBytes = std::uint64_t{2} << 30;  // of messages

inline constexpr std::size_t kDescriptionLimitBytes = std::size_t{4} << 20;

// Of render.proto.
inline constexpr int kAttachmentsLimit = 20'000;
inline constexpr std::uint64_t kAttachmentBytesLimit = std::uint64_t{1} << 30;
inline constexpr std::size_t kFileNameLimitBytes = 4096;

}  // namespace weft::v1
