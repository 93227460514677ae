#include <functional>
#include <string>

#include <gtest/gtest.h>

#include "core/error.h"
#include "security/roles.h"
#include "security/x509.h"

namespace weft::security {
namespace {

const core::Clock::Time kNow{std::chrono::days(20'000)};
constexpr std::chrono::days kYear{365};

Request request_of(const std::string& name) { return {name, {}, {}, kNow, kNow + kYear}; }

std::string message_of_failure(const std::function<void()>& action) {
  try {
    action();
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kInvalidArgument);
    return error.what();
  }
  return "";
}

TEST(X509, ACertificateSaysWhatWasAskedFor) {
  const KeyPair authority = make_authority(request_of("weft of the mill"));
  Request request = request_of("hub");
  request.roles = {v1::ROLE_READER, v1::ROLE_WORKER};
  request.hosts = {"hub.example", "192.168.7.1", "::1"};
  const KeyPair issued = issue(authority, request);
  const Certificate read = read_certificate(issued.certificate);
  EXPECT_EQ(read.name, "hub");
  EXPECT_EQ(read.issuer, "weft of the mill");
  EXPECT_EQ(read.roles, request.roles);
  EXPECT_EQ(read.hosts, request.hosts);
  EXPECT_EQ(read.valid_from, kNow);
  EXPECT_EQ(read.valid_until, kNow + kYear);
  EXPECT_EQ(read.serial.size(), 32U);
  EXPECT_NE(read.serial, read_certificate(issue(authority, request).certificate).serial);
}

TEST(X509, WhoSignedItAndWhoseKeyItIsAreKnown) {
  const KeyPair authority = make_authority(request_of("a"));
  const KeyPair other = make_authority(request_of("a"));  // of the same name
  const KeyPair issued = issue(authority, request_of("ann"));
  const KeyPair another = issue(authority, request_of("ann"));
  EXPECT_TRUE(is_signed_by(issued.certificate, authority.certificate));
  EXPECT_FALSE(is_signed_by(issued.certificate, other.certificate));
  EXPECT_TRUE(belong_together(issued));
  EXPECT_FALSE(belong_together({issued.certificate, another.key}));
  EXPECT_NE(message_of_failure([&] {
              (void)issue({authority.certificate, other.key}, request_of("x"));
            }).find("not the one"),
            std::string::npos);
}

TEST(X509, AListOfRevokedOnesIsTakenFromItsAuthorityOnly) {
  const KeyPair authority = make_authority(request_of("a"));
  const KeyPair other = make_authority(request_of("a"));
  const Revocations revoked = {
      {read_certificate(issue(authority, request_of("ann")).certificate).serial, kNow},
      {read_certificate(issue(authority, request_of("bob")).certificate).serial, kNow + kYear}};
  const std::string list = write_revocations(authority, revoked, kNow);
  EXPECT_EQ(read_revocations(list, authority.certificate), revoked);
  EXPECT_TRUE(
      read_revocations(write_revocations(authority, {}, kNow), authority.certificate).empty());
  EXPECT_NE(message_of_failure([&] {
              (void)read_revocations(list, other.certificate);
            }).find("not signed by"),
            std::string::npos);
  EXPECT_NE(message_of_failure([&] {
              (void)read_revocations(authority.certificate, authority.certificate);
            }).find("no list"),
            std::string::npos);
}

TEST(X509, WhatIsNoHostAndNoCertificateIsRefused) {
  const KeyPair authority = make_authority(request_of("a"));
  for (const char* host : {"", "two words", "x,DNS:y", "-a", "../a", "a\nb"}) {
    Request request = request_of("hub");
    request.hosts = {host};
    EXPECT_NE(message_of_failure([&] { (void)issue(authority, request); }).find("neither"),
              std::string::npos)
        << host;
  }
  EXPECT_NE(message_of_failure([] { (void)read_certificate("hello"); }), "");
  EXPECT_NE(message_of_failure([&] { (void)read_certificate(authority.key); }), "");
  EXPECT_NE(message_of_failure([&] { (void)issue(authority, request_of(std::string(65, 'a'))); }),
            "");
}

TEST(Roles, IncludeWhatTheTableSays) {
  struct Row {
    v1::Role role;
    bool reads, submits, works, administers;
  };
  for (const Row& row : {Row{v1::ROLE_READER, true, false, false, false},
                         Row{v1::ROLE_SUBMITTER, true, true, false, false},
                         Row{v1::ROLE_WORKER, false, false, true, false},
                         Row{v1::ROLE_ADMIN, true, true, true, true},
                         Row{v1::ROLE_UNSPECIFIED, false, false, false, false}}) {
    EXPECT_EQ(includes(row.role, v1::ROLE_READER), row.reads) << row.role;
    EXPECT_EQ(includes(row.role, v1::ROLE_SUBMITTER), row.submits) << row.role;
    EXPECT_EQ(includes(row.role, v1::ROLE_WORKER), row.works) << row.role;
    EXPECT_EQ(includes(row.role, v1::ROLE_ADMIN), row.administers) << row.role;
    EXPECT_FALSE(includes(row.role, v1::ROLE_UNSPECIFIED)) << row.role;
    EXPECT_TRUE(row.role == v1::ROLE_UNSPECIFIED || role_from(to_string(row.role)) == row.role);
  }
  EXPECT_EQ(role_from("Admin"), v1::ROLE_UNSPECIFIED);
  EXPECT_EQ(role_from("unspecified"), v1::ROLE_UNSPECIFIED);
}

}  // namespace
}  // namespace weft::security
