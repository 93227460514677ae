#include <string>

#include <gtest/gtest.h>

#include "fuzz/library_report.h"

namespace weft::fuzz {
namespace {

// What AddressSanitizer of clang 14 prints, shortened.
const std::string kMemcpy = "    #0 0x5629e82eead3 in memcpy (/weft/bin/fuzz_database+0xfaad3)\n";
const std::string kMalloc = "    #0 0x5629e83576ce in malloc (/weft/bin/fuzz_database+0x1636ce)\n";
const std::string kNew =
    "    #0 0x55e8 in operator new(unsigned long) (/weft/bin/fuzz_database+0x1636)\n";
const std::string kLibrary =
    "    #1 0x7f0376ac1fca in H5VM_memcpyvv (/lib/libhdf5_serial.so.103+0x2c1fca) (BuildId: e9)\n";
const std::string kText =
    "    #1 0x7f03 in std::string::_M_create (/lib/libstdc++.so.6+0x2c1fca) (BuildId: e9)\n";
const std::string kOurs =
    "    #2 0x5629 in weft::storage::h5::Reader::read /weft/h5_reader.cpp:297:7\n";
const std::string kUnknown = "    #2 0x6210000c9d77  (<unknown module>)\n";
const std::string kTaken =
    "\n0x6030 is located 0 bytes to the right of 17-byte region\n"
    "allocated by thread T0 here:\n";

bool is_of_library(const std::string& report) {
  return is_in_library("==1==ERROR: AddressSanitizer: heap-buffer-overflow\nREAD of size 24\n" +
                           report + "\nSUMMARY: AddressSanitizer\n",
                       "/weft/bin/fuzz_database");
}

TEST(LibraryReport, IsOneWhoseAccessAndMemoryAreTheLibrarys) {
  EXPECT_TRUE(is_of_library(kMemcpy + kLibrary + kOurs + kTaken + kMalloc + kLibrary + kUnknown));
  EXPECT_TRUE(is_of_library(kMemcpy + kLibrary + kOurs + "\nfreed by thread T0 here:\n" + kMalloc +
                            kLibrary + "\npreviously allocated by thread T0 here:\n" + kNew +
                            kText + kLibrary));
}

TEST(LibraryReport, IsNoneWhenTheMemoryIsOurs) {
  EXPECT_FALSE(is_of_library(kMemcpy + kLibrary + kOurs + kTaken + kNew + kOurs + kLibrary));
  EXPECT_FALSE(is_of_library(kMemcpy + kLibrary + kOurs + kTaken + kNew + kText + kOurs));
  EXPECT_FALSE(is_of_library(kMemcpy + kLibrary + "\nfreed by thread T0 here:\n" + kMalloc + kOurs +
                             "\npreviously allocated by thread T0 here:\n" + kMalloc + kLibrary));
}

TEST(LibraryReport, IsNoneWhenTheAccessIsOurs) {
  EXPECT_FALSE(is_of_library(kMemcpy + kOurs + kTaken + kMalloc + kLibrary));
  EXPECT_FALSE(is_of_library(kOurs + kLibrary + kTaken + kMalloc + kLibrary));
}

TEST(LibraryReport, IsNoneWhenNothingTellsWhoseItIs) {
  EXPECT_FALSE(is_of_library(""));
  EXPECT_FALSE(is_of_library(kMemcpy + kLibrary + kOurs));
  EXPECT_FALSE(is_of_library(kTaken + kMalloc + kLibrary));
  EXPECT_FALSE(is_of_library(kMemcpy + kLibrary + kTaken + kMalloc));
  EXPECT_FALSE(is_of_library(kMemcpy + kLibrary + kTaken + kMalloc + kUnknown));
}

}  // namespace
}  // namespace weft::fuzz
