// SPDX-License-Identifier: Apache-2.0
// Reads the tag files of bags (RFC 8493, BagIt 1.0, and its drafts 0.93 to 0.97) from bytes that
// anybody may have written. Input: whole files in memory; output: their contents in UTF-8, and what
// is wrong with them. Cost: linear in the bytes.
#pragma once

#include <compare>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace raystage::store {

struct BagVersion {
  int major = 1, minor = 0;  ///< 0.97: {0, 97}
  auto operator<=>(const BagVersion&) const = default;
};
inline constexpr BagVersion kBagVersion1{1, 0};

/// What is wrong with a tag file.
class TagFileFindings {
 public:
  /// A bag with a fault is not valid.
  void fault(std::string what);
  /// A bag with a warning is valid, but other programs may read it in another way.
  void warning(std::string what);

  const std::vector<std::string>& faults() const { return faults_; }
  const std::vector<std::string>& warnings() const { return warnings_; }
  /// Number of faults and warnings that are not listed, because there are more than kMost of
  /// either.
  std::uint64_t omitted() const { return omitted_; }
  static constexpr std::size_t kMost = 100;

 private:
  std::vector<std::string> faults_, warnings_;
  std::uint64_t omitted_ = 0;
};

/// bagit.txt.
struct BagDeclaration {
  BagVersion version;
  std::string encoding = "UTF-8";  ///< of all other tag files, as it is stated
};
/// Returns nullopt if no version or encoding can be found.
std::optional<BagDeclaration> parse_bag_declaration(std::string_view bytes,
                                                    TagFileFindings& findings);

/// Returns the text of a tag file in UTF-8, without a byte order mark. Returns nullopt if the
/// encoding is not UTF-8, US-ASCII, ISO-8859-1, UTF-16, UTF-16LE or UTF-16BE, or if the bytes are
/// invalid in it.
std::optional<std::string> utf8_of_tag_file(std::string_view bytes, std::string_view encoding,
                                            TagFileFindings& findings);

/// Returns a path as manifests write it: line ends and '%' percent-encoded.
std::string encode_bag_path(std::string_view path);
/// Returns the path that a manifest or fetch.txt states, relative to the bag: percent-encoding is
/// decoded as the version states, "./" and "//" are removed. Returns nullopt if it is empty,
/// absolute, begins with '~', has a part "..", or names a folder.
std::optional<std::string> decode_bag_path(std::string_view text, BagVersion version,
                                           TagFileFindings& findings);

/// A payload or tag manifest.
struct BagManifest {
  struct Entry {
    std::string path;    ///< relative to the bag, decoded
    std::string digest;  ///< lower-case hexadecimal digits
  };
  std::vector<Entry> entries;  ///< sorted by path, each once
};
/// Parses the lines of a manifest. `digits`: of a digest; 0: any number. Lines that are wrong are
/// left out and are faults.
BagManifest parse_bag_manifest(std::string_view text, BagVersion version, std::size_t digits,
                               TagFileFindings& findings);

/// A line of fetch.txt: a payload file that the bag does not hold.
struct BagFetchEntry {
  std::string url;
  std::optional<std::uint64_t> bytes;  ///< nullopt: "-"
  std::string path;                    ///< relative to the bag, decoded
};
std::vector<BagFetchEntry> parse_bag_fetch(std::string_view text, BagVersion version,
                                           TagFileFindings& findings);

/// bag-info.txt, in the order of the file; labels may repeat.
struct BagInfo {
  struct Element {
    std::string label, value;  ///< lines that continue a value are joined by a space
  };
  std::vector<Element> elements;
  /// Payload-Oxum, if it is stated and can be read.
  struct Oxum {
    std::uint64_t bytes = 0, files = 0;
  };
  std::optional<Oxum> oxum;
};
BagInfo parse_bag_info(std::string_view text, BagVersion version, TagFileFindings& findings);

}  // namespace raystage::store
