#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/clock.h"
#include "proto/weft/v1/roles.pb.h"

namespace weft::security {

// X.509 as weft uses it: one authority, certificates that it signed, and its list of those that it
// revoked. All texts are PEM. The only file pair that knows certificates' insides.

// What a certificate says, as far as weft asks.
struct Certificate {
  std::string name;                // the subject's common name: a user, or a machine
  std::vector<v1::Role> roles;     // from its URIs weft:role/ROLE
  std::vector<std::string> hosts;  // names and addresses that a server with it may have
  std::string issuer;              // common name of who signed it
  std::string serial;              // lower-case hexadecimal
  core::Clock::Time valid_from;
  core::Clock::Time valid_until;
};

struct KeyPair {
  std::string certificate;
  std::string key;
};

struct Request {
  std::string name;
  std::vector<v1::Role> roles;
  std::vector<std::string> hosts;  // empty: no server can use the certificate
  core::Clock::Time valid_from;
  core::Clock::Time valid_until;
};

// Serials, and when each was revoked.
using Revocations = std::map<std::string, core::Clock::Time>;

// The first certificate of `pem`. Throws core::Error(kInvalidArgument) when there is none.
[[nodiscard]] Certificate read_certificate(const std::string& pem);

// A new authority: a P-256 key and a certificate that may sign certificates and lists, no more.
[[nodiscard]] KeyPair make_authority(const Request& request);

// A new P-256 key and its certificate with a random serial. Throws core::Error(kInvalidArgument)
// when the authority's texts are not a certificate and its key, or a host is neither a name nor an
// address.
[[nodiscard]] KeyPair issue(const KeyPair& authority, const Request& request);

// The authority's list of what it revoked, signed.
[[nodiscard]] std::string write_revocations(const KeyPair& authority, const Revocations& revoked,
                                            core::Clock::Time now);
// Throws core::Error(kInvalidArgument) when `list` is none, or not signed by `authority`.
[[nodiscard]] Revocations read_revocations(const std::string& list, const std::string& authority);

// Whether `key` is the private key of `certificate`.
[[nodiscard]] bool belong_together(const KeyPair& pair);

// Whether `authority` signed `certificate`; dates are not asked.
[[nodiscard]] bool is_signed_by(const std::string& certificate, const std::string& authority);

}  // namespace weft::security
