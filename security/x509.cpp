#include "security/x509.h"

#include <algorithm>
#include <climits>
#include <memory>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <openssl/bio.h>
#include <openssl/bn.h>
#include <openssl/ec.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

#include "core/error.h"
#include "security/roles.h"

namespace weft::security {

namespace {

constexpr int kSerialBytes = 16;
constexpr const char* kRoleUri = "weft:role/";
// A list is used until the next one comes; no date ends it.
constexpr auto kListLife = std::chrono::days(20 * 365);

template <class T, void (*Free)(T*)>
struct Freer {
  void operator()(T* t) const { Free(t); }
};
using Bio = std::unique_ptr<BIO, Freer<BIO, BIO_free_all>>;
using Cert = std::unique_ptr<X509, Freer<X509, X509_free>>;
using Key = std::unique_ptr<EVP_PKEY, Freer<EVP_PKEY, EVP_PKEY_free>>;
using Crl = std::unique_ptr<X509_CRL, Freer<X509_CRL, X509_CRL_free>>;
using Number = std::unique_ptr<BIGNUM, Freer<BIGNUM, BN_free>>;
using Integer = std::unique_ptr<ASN1_INTEGER, Freer<ASN1_INTEGER, ASN1_INTEGER_free>>;
using Time = std::unique_ptr<ASN1_TIME, Freer<ASN1_TIME, ASN1_TIME_free>>;
using Names = std::unique_ptr<GENERAL_NAMES, Freer<GENERAL_NAMES, GENERAL_NAMES_free>>;
using Extension = std::unique_ptr<X509_EXTENSION, Freer<X509_EXTENSION, X509_EXTENSION_free>>;
using Revoked = std::unique_ptr<X509_REVOKED, Freer<X509_REVOKED, X509_REVOKED_free>>;

[[noreturn]] void fail(const std::string& what) {
  // What OpenSSL itself says is a matter of its insides; it would not help a person.
  ERR_clear_error();
  throw core::Error(core::Code::kInvalidArgument, what);
}

// OpenSSL answers 0 or less only when memory is short or a text is wrong.
void require(bool done, const char* what) {
  if (!done) {
    fail(std::string("OpenSSL cannot ") + what);
  }
}

Bio reader(const std::string& text) {
  Bio bio(
      BIO_new_mem_buf(text.data(), static_cast<int>(std::min<std::size_t>(text.size(), INT_MAX))));
  require(bio != nullptr, "read a text");
  return bio;
}

std::string text_of(BIO& bio) {
  char* data = nullptr;
  const long size = BIO_get_mem_data(&bio, &data);
  return {data, static_cast<std::size_t>(size)};
}

// A key is never asked for a password: the files that weft writes have none.
int no_password(char* /*buffer*/, int /*size*/, int /*writing*/, void* /*data*/) { return -1; }

Cert certificate_from(const std::string& pem) {
  Cert certificate(PEM_read_bio_X509(reader(pem).get(), nullptr, no_password, nullptr));
  if (!certificate) {
    fail("it holds no certificate (PEM)");
  }
  return certificate;
}

Key key_from(const std::string& pem) {
  Key key(PEM_read_bio_PrivateKey(reader(pem).get(), nullptr, no_password, nullptr));
  if (!key) {
    fail("it holds no private key (PEM without a password)");
  }
  return key;
}

std::string common_name(const X509_NAME* name) {
  const int at = X509_NAME_get_index_by_NID(name, NID_commonName, -1);
  if (at < 0) {
    return "";
  }
  unsigned char* utf8 = nullptr;
  const int size =
      ASN1_STRING_to_UTF8(&utf8, X509_NAME_ENTRY_get_data(X509_NAME_get_entry(name, at)));
  if (size < 0) {
    ERR_clear_error();
    return "";
  }
  std::string text(reinterpret_cast<char*>(utf8), static_cast<std::size_t>(size));
  OPENSSL_free(utf8);
  return text;
}

std::string serial_of(const ASN1_INTEGER* serial) {
  const Number number(ASN1_INTEGER_to_BN(serial, nullptr));
  char* hex = number ? BN_bn2hex(number.get()) : nullptr;
  if (hex == nullptr) {
    fail("its serial cannot be read");
  }
  std::string text(hex);
  OPENSSL_free(hex);
  std::transform(text.begin(), text.end(), text.begin(), [](char c) {
    return c >= 'A' && c <= 'F' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return text;
}

Integer serial_from(const std::string& hex) {
  BIGNUM* number = nullptr;
  require(BN_hex2bn(&number, hex.c_str()) == static_cast<int>(hex.size()), "read a serial");
  const Number owned(number);
  Integer serial(BN_to_ASN1_INTEGER(number, nullptr));
  require(serial != nullptr, "write a serial");
  return serial;
}

core::Clock::Time time_of(const ASN1_TIME* time) {
  const Time epoch(ASN1_TIME_set(nullptr, 0));
  int days = 0;
  int seconds = 0;
  if (!epoch || ASN1_TIME_diff(&days, &seconds, epoch.get(), time) != 1) {
    fail("a date in it cannot be read");
  }
  return core::Clock::Time(std::chrono::days(days) + std::chrono::seconds(seconds));
}

Time time_from(core::Clock::Time time) {
  Time converted(ASN1_TIME_set(
      nullptr, std::chrono::duration_cast<std::chrono::seconds>(time.time_since_epoch()).count()));
  require(converted != nullptr, "write a date");
  return converted;
}

std::string text_of(const ASN1_STRING* string) {
  return {reinterpret_cast<const char*>(ASN1_STRING_get0_data(string)),
          static_cast<std::size_t>(ASN1_STRING_length(string))};
}

std::string address_of(const ASN1_OCTET_STRING* bytes) {
  const std::string raw = text_of(bytes);
  char text[INET6_ADDRSTRLEN] = "";
  const int family = raw.size() == sizeof(in_addr) ? AF_INET : AF_INET6;
  const bool is_address = raw.size() == sizeof(in_addr) || raw.size() == sizeof(in6_addr);
  return is_address && inet_ntop(family, raw.data(), text, sizeof(text)) != nullptr ? text : "";
}

void read_names(const X509& certificate, Certificate& read) {
  const Names names(static_cast<GENERAL_NAMES*>(
      X509_get_ext_d2i(&certificate, NID_subject_alt_name, nullptr, nullptr)));
  const std::string uri = kRoleUri;
  for (int i = 0; names && i < sk_GENERAL_NAME_num(names.get()); ++i) {
    const GENERAL_NAME* name = sk_GENERAL_NAME_value(names.get(), i);
    if (name->type == GEN_DNS) {
      read.hosts.push_back(text_of(name->d.dNSName));
    } else if (name->type == GEN_IPADD) {
      read.hosts.push_back(address_of(name->d.iPAddress));
    } else if (name->type == GEN_URI) {
      const std::string text = text_of(name->d.uniformResourceIdentifier);
      const v1::Role role =
          text.starts_with(uri) ? role_from(text.substr(uri.size())) : v1::ROLE_UNSPECIFIED;
      if (role != v1::ROLE_UNSPECIFIED) {
        read.roles.push_back(role);
      }
    }
  }
  std::sort(read.roles.begin(), read.roles.end());
}

Key new_key() {
  Key key(EVP_EC_gen("P-256"));
  require(key != nullptr, "make a key");
  return key;
}

std::string pem_of(X509& certificate) {
  const Bio bio(BIO_new(BIO_s_mem()));
  require(bio && PEM_write_bio_X509(bio.get(), &certificate) == 1, "write a certificate");
  return text_of(*bio);
}

std::string pem_of(EVP_PKEY& key) {
  const Bio bio(BIO_new(BIO_s_mem()));
  require(bio && PEM_write_bio_PKCS8PrivateKey(bio.get(), &key, nullptr, nullptr, 0, nullptr,
                                               nullptr) == 1,
          "write a key");
  return text_of(*bio);
}

void add_extension(X509& certificate, X509& issuer, int nid, const std::string& value) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  X509V3_set_ctx(&context, &issuer, &certificate, nullptr, nullptr, 0);
  const Extension extension(X509V3_EXT_conf_nid(nullptr, &context, nid, value.c_str()));
  require(extension && X509_add_ext(&certificate, extension.get(), -1) == 1,
          "write an extension of a certificate");
}

// Names are added one by one as data, never through OpenSSL's configuration language, in which a
// comma in a name would begin the next one.
void add_name(GENERAL_NAMES& names, int type, const std::string& value) {
  std::unique_ptr<GENERAL_NAME, Freer<GENERAL_NAME, GENERAL_NAME_free>> name(GENERAL_NAME_new());
  require(name != nullptr, "write a name");
  ASN1_STRING* string = nullptr;
  if (type == GEN_IPADD) {
    string = a2i_IPADDRESS(value.c_str());
  } else {
    string = ASN1_IA5STRING_new();
    require(string != nullptr &&
                ASN1_STRING_set(string, value.data(), static_cast<int>(value.size())) == 1,
            "write a name");
  }
  require(string != nullptr, "write an address");
  GENERAL_NAME_set0_value(name.get(), type, string);
  require(sk_GENERAL_NAME_push(&names, name.get()) > 0, "write a name");
  static_cast<void>(name.release());
}

bool is_address(const std::string& host) {
  const std::unique_ptr<ASN1_OCTET_STRING, Freer<ASN1_OCTET_STRING, ASN1_OCTET_STRING_free>> bytes(
      a2i_IPADDRESS(host.c_str()));
  ERR_clear_error();
  return bytes != nullptr;
}

bool is_host_name(const std::string& host) {
  return !host.empty() && host.size() <= 253 && host.front() != '.' && host.front() != '-' &&
         host.find_first_not_of(
             "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789.-") ==
             std::string::npos;
}

void add_names(X509& certificate, const Request& request) {
  const Names names(GENERAL_NAMES_new());
  require(names != nullptr, "write names");
  for (const v1::Role role : request.roles) {
    add_name(*names, GEN_URI, kRoleUri + to_string(role));
  }
  for (const std::string& host : request.hosts) {
    if (!is_address(host) && !is_host_name(host)) {
      fail("'" + host + "' is neither a host's name nor its address");
    }
    add_name(*names, is_address(host) ? GEN_IPADD : GEN_DNS, host);
  }
  require(X509_add1_ext_i2d(&certificate, NID_subject_alt_name, names.get(), 0,
                            X509V3_ADD_DEFAULT) == 1,
          "write names");
}

std::string random_serial() {
  unsigned char bytes[kSerialBytes];
  require(RAND_bytes(bytes, kSerialBytes) == 1, "draw a serial");
  bytes[0] = static_cast<unsigned char>((bytes[0] & 0x3FU) | 0x40U);  // positive, of full length
  std::string hex;
  for (const unsigned char byte : bytes) {
    hex += fmt::format("{:02x}", byte);
  }
  return hex;
}

// All that authority and issued certificates have alike.
Cert new_certificate(const Request& request, EVP_PKEY& key) {
  Cert certificate(X509_new());
  require(certificate && X509_set_version(certificate.get(), X509_VERSION_3) == 1 &&
              X509_set_serialNumber(certificate.get(), serial_from(random_serial()).get()) == 1 &&
              X509_set1_notBefore(certificate.get(), time_from(request.valid_from).get()) == 1 &&
              X509_set1_notAfter(certificate.get(), time_from(request.valid_until).get()) == 1 &&
              X509_set_pubkey(certificate.get(), &key) == 1,
          "write a certificate");
  X509_NAME* subject = X509_get_subject_name(certificate.get());
  require(X509_NAME_add_entry_by_NID(subject, NID_commonName, MBSTRING_UTF8,
                                     reinterpret_cast<const unsigned char*>(request.name.data()),
                                     static_cast<int>(request.name.size()), -1, 0) == 1,
          "write a name of so many bytes; 64 are the most");
  return certificate;
}

}  // namespace

Certificate read_certificate(const std::string& pem) {
  const Cert certificate = certificate_from(pem);
  Certificate read;
  read.name = common_name(X509_get_subject_name(certificate.get()));
  read.issuer = common_name(X509_get_issuer_name(certificate.get()));
  read.serial = serial_of(X509_get0_serialNumber(certificate.get()));
  read.valid_from = time_of(X509_get0_notBefore(certificate.get()));
  read.valid_until = time_of(X509_get0_notAfter(certificate.get()));
  read_names(*certificate, read);
  return read;
}

KeyPair make_authority(const Request& request) {
  const Key key = new_key();
  const Cert certificate = new_certificate(request, *key);
  require(X509_set_issuer_name(certificate.get(), X509_get_subject_name(certificate.get())) == 1,
          "name an issuer");
  add_extension(*certificate, *certificate, NID_basic_constraints, "critical,CA:TRUE,pathlen:0");
  add_extension(*certificate, *certificate, NID_key_usage, "critical,keyCertSign,cRLSign");
  add_extension(*certificate, *certificate, NID_subject_key_identifier, "hash");
  require(X509_sign(certificate.get(), key.get(), EVP_sha256()) > 0, "sign");
  return {pem_of(*certificate), pem_of(*key)};
}

KeyPair issue(const KeyPair& authority, const Request& request) {
  const Cert issuer = certificate_from(authority.certificate);
  const Key issuer_key = key_from(authority.key);
  if (X509_check_private_key(issuer.get(), issuer_key.get()) != 1) {
    fail("the authority's key is not the one of its certificate");
  }
  const Key key = new_key();
  const Cert certificate = new_certificate(request, *key);
  require(X509_set_issuer_name(certificate.get(), X509_get_subject_name(issuer.get())) == 1,
          "name an issuer");
  add_extension(*certificate, *issuer, NID_basic_constraints, "critical,CA:FALSE");
  add_extension(*certificate, *issuer, NID_key_usage, "critical,digitalSignature");
  add_extension(*certificate, *issuer, NID_ext_key_usage,
                request.hosts.empty() ? "clientAuth" : "clientAuth,serverAuth");
  add_extension(*certificate, *issuer, NID_subject_key_identifier, "hash");
  add_extension(*certificate, *issuer, NID_authority_key_identifier, "keyid:always");
  add_names(*certificate, request);
  require(X509_sign(certificate.get(), issuer_key.get(), EVP_sha256()) > 0, "sign");
  return {pem_of(*certificate), pem_of(*key)};
}

std::string write_revocations(const KeyPair& authority, const Revocations& revoked,
                              core::Clock::Time now) {
  const Cert issuer = certificate_from(authority.certificate);
  const Key key = key_from(authority.key);
  const Crl list(X509_CRL_new());
  require(list && X509_CRL_set_version(list.get(), X509_CRL_VERSION_2) == 1 &&
              X509_CRL_set_issuer_name(list.get(), X509_get_subject_name(issuer.get())) == 1 &&
              X509_CRL_set1_lastUpdate(list.get(), time_from(now).get()) == 1 &&
              X509_CRL_set1_nextUpdate(list.get(), time_from(now + kListLife).get()) == 1,
          "write a list");
  for (const auto& [serial, when] : revoked) {
    Revoked entry(X509_REVOKED_new());
    require(entry && X509_REVOKED_set_serialNumber(entry.get(), serial_from(serial).get()) == 1 &&
                X509_REVOKED_set_revocationDate(entry.get(), time_from(when).get()) == 1 &&
                X509_CRL_add0_revoked(list.get(), entry.get()) == 1,
            "add to a list");
    static_cast<void>(entry.release());
  }
  require(X509_CRL_sort(list.get()) == 1 && X509_CRL_sign(list.get(), key.get(), EVP_sha256()) > 0,
          "sign a list");
  const Bio bio(BIO_new(BIO_s_mem()));
  require(bio && PEM_write_bio_X509_CRL(bio.get(), list.get()) == 1, "write a list");
  return text_of(*bio);
}

Revocations read_revocations(const std::string& list, const std::string& authority) {
  const Crl read(PEM_read_bio_X509_CRL(reader(list).get(), nullptr, no_password, nullptr));
  if (!read) {
    fail("it holds no list of revoked certificates (PEM)");
  }
  const Cert issuer = certificate_from(authority);
  if (X509_CRL_verify(read.get(), X509_get0_pubkey(issuer.get())) != 1) {
    fail("it is not signed by the authority '" + common_name(X509_get_subject_name(issuer.get())) +
         "' that is trusted here");
  }
  Revocations revoked;
  STACK_OF(X509_REVOKED)* entries = X509_CRL_get_REVOKED(read.get());
  for (int i = 0; i < sk_X509_REVOKED_num(entries); ++i) {
    const X509_REVOKED* entry = sk_X509_REVOKED_value(entries, i);
    revoked.emplace(serial_of(X509_REVOKED_get0_serialNumber(entry)),
                    time_of(X509_REVOKED_get0_revocationDate(entry)));
  }
  return revoked;
}

bool belong_together(const KeyPair& pair) {
  const bool match = X509_check_private_key(certificate_from(pair.certificate).get(),
                                            key_from(pair.key).get()) == 1;
  ERR_clear_error();
  return match;
}

bool is_signed_by(const std::string& certificate, const std::string& authority) {
  const Cert issuer = certificate_from(authority);
  const bool match =
      X509_verify(certificate_from(certificate).get(), X509_get0_pubkey(issuer.get())) == 1;
  ERR_clear_error();
  return match;
}

}  // namespace weft::security
