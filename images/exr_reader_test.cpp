// SPDX-License-Identifier: Apache-2.0
#include "images/exr_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "base/atomic_file.h"
#include "base/error.h"
#include "testing/test_folder.h"

namespace raystage::images {
namespace {

using ::testing::HasSubstr;

std::string little_endian(std::uint32_t value) {
  std::string bytes;
  for (int i = 0; i < 4; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xFF);
  return bytes;
}

/// Returns the beginning of an EXR file with one attribute.
std::string file_with(const std::string& type, std::uint32_t size, const std::string& data) {
  return little_endian(20000630) + little_endian(2) + "a" + '\0' + type + '\0' +
         little_endian(size) + data;
}

class ExrHeaders : public ::testing::Test {
 protected:
  std::string complaint(const std::string& bytes) {
    const auto file = folder_.path() / "a.exr";
    write_file_atomically(file, bytes);
    try {
      reader_.size(file, {}, "Give another");
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      return error.what();
    }
    return "";
  }

  testing::TestFolder folder_;
  ExrReader reader_{10'000'000};
};

// OpenEXR allocates what an attribute states to have.
TEST_F(ExrHeaders, AttributesLargerThanTheFileAreRefused) {
  const char* const kRefused = "states to be larger than the file";
  EXPECT_THAT(complaint(file_with("string", 0x7FFFFFFF, "abc")), HasSubstr(kRefused));
  EXPECT_THAT(complaint(file_with("stringvector", 8, little_endian(0x4E657372) + "abcd")),
              HasSubstr(kRefused));
  EXPECT_THAT(
      complaint(file_with("stringvector", 9, little_endian(1) + "a" + little_endian(0x7FFFFFFF))),
      HasSubstr(kRefused));
  // What is no EXR file, or ends early, is named by OpenEXR.
  for (const std::string& bytes :
       {std::string(), std::string("no EXR file"), file_with("string", 3, "ab")}) {
    EXPECT_THAT(complaint(bytes), HasSubstr("the EXR file cannot be read"));
  }
}

}  // namespace
}  // namespace raystage::images
