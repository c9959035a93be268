// SPDX-License-Identifier: Apache-2.0
// Walks the headers of an EXR file (OpenEXR file layout): attributes of a name, a type, a size and
// data, until an empty name; of several parts until an empty header. Cost: one read for each
// attribute.
#include "images/exr_header_check.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <stdexcept>
#include <string>

namespace raystage::images {
namespace {

class HeaderWalk {
 public:
  HeaderWalk(std::istream& file, std::uint64_t bytes) : file_(file), left_(bytes) {}

  void run() {
    constexpr std::uint32_t kMagic = 20000630, kSeveralParts = 0x1000;
    if (number() != kMagic) return;
    const bool has_parts = (number() & kSeveralParts) != 0;
    while (file_ && header() && has_parts) {
    }
  }

 private:
  /// Returns whether the header has attributes.
  bool header() {
    bool has_attributes = false;
    for (std::string name = text(); file_ && !name.empty(); name = text()) {
      has_attributes = true;
      const std::string type = text();
      const std::uint32_t size = number();
      require(size);
      if (type == "stringvector") {
        string_vector(size);
      } else {
        skip(size);
      }
    }
    return has_attributes;
  }

  /// Each string has its length before it.
  void string_vector(std::uint32_t size) {
    while (file_ && size >= 4) {
      const std::uint32_t length = number();
      size -= 4;
      require(length);
      skip(length);
      if (length > size) return;
      size -= length;
    }
    skip(size);
  }

  void require(std::uint64_t bytes) const {
    if (file_ && bytes > left_) {
      throw std::runtime_error("an attribute of its header states to be larger than the file");
    }
  }

  std::string text() {
    constexpr std::size_t kLongest = 255;
    std::string text;
    for (char c = 0; text.size() <= kLongest && file_.get(c) && c != '\0';) text += c;
    left_ -= std::min<std::uint64_t>(left_, text.size() + 1);
    return text;
  }

  std::uint32_t number() {
    std::array<char, 4> bytes{};
    file_.read(bytes.data(), bytes.size());
    left_ -= std::min<std::uint64_t>(left_, bytes.size());
    std::uint32_t value = 0;
    for (std::size_t i = bytes.size(); i-- > 0;) {
      value = value << 8 | static_cast<std::uint8_t>(bytes[i]);
    }
    return value;
  }

  void skip(std::uint64_t bytes) {
    file_.ignore(static_cast<std::streamsize>(bytes));
    left_ -= std::min(left_, bytes);
  }

  std::istream& file_;
  std::uint64_t left_;
};

}  // namespace

void require_plausible_exr_header(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  stream.seekg(0, std::ios::end);
  const std::streamoff bytes = stream.tellg();
  stream.seekg(0);
  if (!stream || bytes < 0) return;  // OpenEXR names the reason
  HeaderWalk(stream, static_cast<std::uint64_t>(bytes)).run();
}

}  // namespace raystage::images
