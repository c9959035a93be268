// SPDX-License-Identifier: Apache-2.0
#include "store/bagit/tag_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "store/bagit/digests.h"
#include "testing/store/bag_test_data.h"

namespace raystage::store {
namespace tag_files_test {

using testing::digest_of;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

/// The path that a manifest of a version states, or "refused".
std::string decoded(std::string_view text, BagVersion version = kBagVersion1) {
  TagFileFindings findings;
  const auto path = decode_bag_path(text, version, findings);
  EXPECT_EQ(path.has_value(), findings.faults().empty());
  return path.value_or("refused");
}

TEST(BagDigests, AreThoseOfTheStandards) {
  EXPECT_EQ(digest_of("abc", DigestAlgorithm::kMd5), "900150983cd24fb0d6963f7d28e17f72");
  EXPECT_EQ(digest_of("abc", DigestAlgorithm::kSha1), "a9993e364706816aba3e25717850c26c9cd0d89d");
  EXPECT_EQ(digest_of("abc", DigestAlgorithm::kSha224),
            "23097d223405d8228642a477bda255b32aadbce4bda0b3f7e36c9da7");
  EXPECT_EQ(digest_of("abc", DigestAlgorithm::kSha256),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(digest_of("abc", DigestAlgorithm::kSha384),
            "cb00753f45a35e8bb5a03d699ac65007272c32ab0eded1631a8b605a43ff5bed"
            "8086072ba1e7cc2358baeca134c825a7");
  EXPECT_EQ(digest_of("abc", DigestAlgorithm::kSha512),
            "ddaf35a193617abacc417349ae20413112e6fa4e89a97ea20a9eeee64b55d39a"
            "2192992a274fc1a836ba3c23a3feebbd454d4423643ce80e2a9ac94fa54ca49f");
  for (const char* name : {"md5", "sha1", "sha224", "sha256", "sha384", "sha512"}) {
    const DigestAlgorithm algorithm = digest_algorithm(name).value();
    EXPECT_EQ(digest_name(algorithm), name);
    EXPECT_EQ(digest_of("", algorithm).size(), digest_digits(algorithm));
  }
  EXPECT_EQ(digest_algorithm("SHA-256"), DigestAlgorithm::kSha256);
  EXPECT_EQ(digest_algorithm("sha3256"), std::nullopt);
}

TEST(BagDeclaration, IsTwoLines) {
  TagFileFindings findings;
  const auto good = parse_bag_declaration(
      "BagIt-Version: 0.97\r\nTag-File-Character-Encoding: UTF-16\r\n", findings);
  ASSERT_TRUE(good);
  EXPECT_EQ(good->version, (BagVersion{0, 97}));
  EXPECT_EQ(good->encoding, "UTF-16");
  EXPECT_THAT(findings.faults(), IsEmpty());
  for (const char* bad :
       {"", "BagIt-Version: 1.0\n", "BagIt-Version: 1\nTag-File-Character-Encoding: UTF-8\n",
        "Tag-File-Character-Encoding: UTF-8\nBagIt-Version: 1.0\n",
        "BagIt-Version: -1.0\nTag-File-Character-Encoding: UTF-8\n",
        "BagIt-Version: 1.99999999999999999999\nTag-File-Character-Encoding: UTF-8\n"}) {
    TagFileFindings found;
    EXPECT_FALSE(parse_bag_declaration(bad, found)) << bad;
    EXPECT_THAT(found.faults(), SizeIs(1));
  }
  const std::string marked =
      std::string("\xef\xbb\xbf") + "BagIt-Version: 1.0\nTag-File-Character-Encoding: UTF-8\n";
  for (const char* odd :
       {"BagIt-Version : 1.0\nTag-File-Character-Encoding: UTF-8\n",
        "BagIt-Version:1.0\nTag-File-Character-Encoding: UTF-8\n",
        "BagIt-Version: 1.0 \nTag-File-Character-Encoding: UTF-8\n",
        "BagIt-Version:  1.0\nTag-File-Character-Encoding: UTF-8\n",
        "BagIt-Version: 1.0\nTag-File-Character-Encoding: UTF-8\nmore\n", marked.c_str()}) {
    TagFileFindings found;
    EXPECT_TRUE(parse_bag_declaration(odd, found)) << odd;
    EXPECT_THAT(found.faults(), SizeIs(1)) << odd;
  }
}

TEST(BagPaths, AreEncodedAndComeBack) {
  for (const char* path : {"data/a", "data/100%", "data/a\nb\rc", "data/%0A", "data/\xc3\xa9 b"}) {
    EXPECT_EQ(decoded(encode_bag_path(path)), path);
  }
  EXPECT_EQ(encode_bag_path("data/a\r\n%"), "data/a%0D%0A%25");
}

TEST(BagPaths, OldVersionsEncodeOnlyLineEnds) {
  EXPECT_EQ(decoded("data/50%25", {0, 97}), "data/50%25");
  EXPECT_EQ(decoded("data/a%0ab", {0, 97}), "data/a\nb");
  EXPECT_EQ(decoded("data/a%20b"), "data/a%20b");  // no other character is encoded
}

TEST(BagPaths, ThatLeaveTheBagAreRefused) {
  for (const char* path : {"", "/etc/passwd", "~/a", "~root/a", "./~a", ".//~root/a", "../a",
                           "data/../../a", "data/a/..", "data/", ".", "./", "data/a/../b"}) {
    EXPECT_EQ(decoded(path), "refused") << path;
  }
  EXPECT_EQ(decoded(std::string_view("data/a\0b", 8)), "refused");
  EXPECT_EQ(decoded("./data//a"), "data/a");
  EXPECT_EQ(decoded("data/~a"), "data/~a");
  EXPECT_EQ(decoded("data/..a/b.."), "data/..a/b..");
}

TEST(BagManifests, ListPathsWithDigests) {
  const std::string a(64, 'A'), b(64, 'b');
  TagFileFindings findings;
  const BagManifest manifest = parse_bag_manifest(a + " data/two words \r" + b + " \t *data/b\r\n",
                                                  kBagVersion1, 64, findings);
  ASSERT_THAT(manifest.entries, SizeIs(2));
  EXPECT_EQ(manifest.entries[0].path, "data/b");
  EXPECT_EQ(manifest.entries[1].path, "data/two words ");
  EXPECT_EQ(manifest.entries[1].digest, std::string(64, 'a'));
  EXPECT_THAT(findings.faults(), IsEmpty());
  EXPECT_THAT(findings.warnings(), SizeIs(1));
}

TEST(BagManifests, WrongLinesAreFaults) {
  for (const std::string& line :
       {std::string("data/a"), std::string(63, 'a') + "  data/a", std::string(64, 'g') + "  data/a",
        std::string(64, 'a'), std::string(64, 'a') + "  "}) {
    TagFileFindings findings;
    EXPECT_THAT(parse_bag_manifest(line, kBagVersion1, 64, findings).entries, IsEmpty()) << line;
    EXPECT_THAT(findings.faults(), SizeIs(1)) << line;
  }
}

TEST(BagManifests, APathTwiceIsAFaultUnlessAnOldVersionRepeatsTheLine) {
  const std::string a = std::string(32, 'a') + "  data/a\n",
                    b = std::string(32, 'b') + "  data/a\n";
  const auto faults = [](const std::string& text, BagVersion version) {
    TagFileFindings findings;
    EXPECT_THAT(parse_bag_manifest(text, version, 32, findings).entries, SizeIs(1));
    return findings.faults().size();
  };
  EXPECT_EQ(faults(a + a, kBagVersion1), 1);
  EXPECT_EQ(faults(a + a, {0, 97}), 0);
  EXPECT_EQ(faults(a + b, {0, 97}), 1);
}

TEST(BagManifests, FaultsOfHostileFilesAreLimited) {
  std::string text;
  for (int i = 0; i < 1000; ++i) text += "x\n";
  TagFileFindings findings;
  parse_bag_manifest(text, kBagVersion1, 64, findings);
  EXPECT_THAT(findings.faults(), SizeIs(TagFileFindings::kMost));
  EXPECT_EQ(findings.omitted(), 1000 - TagFileFindings::kMost);
}

TEST(BagInfo, ValuesContinueOnLinesThatBeginWithWhiteSpace) {
  TagFileFindings findings;
  const BagInfo info = parse_bag_info(
      "Source-Organization: A\r\n  B\r\n\tC\r\nContact-Name:\n D\nContact-Name: E:F\n"
      "payload-oxum: 12.3\n",
      kBagVersion1, findings);
  std::vector<std::string> values;
  for (const auto& element : info.elements) values.push_back(element.value);
  EXPECT_THAT(values, ElementsAre("A B C", "D", "E:F", "12.3"));
  ASSERT_TRUE(info.oxum);
  EXPECT_EQ(info.oxum->bytes, 12);
  EXPECT_EQ(info.oxum->files, 3);
  EXPECT_THAT(findings.faults(), IsEmpty());
}

TEST(BagInfo, WhatCannotBeReadIsAFault) {
  for (const char* bad : {" continued\n", "no colon\n", ": no label\n", "A : b\n",
                          "Payload-Oxum: 1.1\nPayload-Oxum: 1.1\n", "Payload-Oxum: 1\n",
                          "Payload-Oxum: -1.1\n", "Payload-Oxum: 99999999999999999999.1\n"}) {
    TagFileFindings findings;
    parse_bag_info(bad, kBagVersion1, findings);
    EXPECT_THAT(findings.faults(), SizeIs(1)) << bad;
  }
}

TEST(BagFetch, HasUrlLengthAndPath) {
  TagFileFindings findings;
  const auto entries =
      parse_bag_fetch("http://a/b 12 data/a b\nhttp://a/c - data/c%0A\n\n", kBagVersion1, findings);
  ASSERT_THAT(entries, SizeIs(2));
  EXPECT_EQ(entries[0].path, "data/a b");
  EXPECT_EQ(entries[0].bytes, 12);
  EXPECT_EQ(entries[1].path, "data/c\n");
  EXPECT_EQ(entries[1].bytes, std::nullopt);
  EXPECT_THAT(findings.faults(), IsEmpty());
  for (const char* bad : {"http://a/b", "http://a/b 12", "http://a/b x data/a",
                          "http://a/b 1 ../../a", "http://a/b 1 ~/a"}) {
    TagFileFindings found;
    EXPECT_THAT(parse_bag_fetch(bad, kBagVersion1, found), IsEmpty()) << bad;
    EXPECT_THAT(found.faults(), SizeIs(1)) << bad;
  }
}

TEST(TagFileEncodings, BecomeUtf8) {
  const auto converted = [](std::string_view bytes, const char* encoding) {
    TagFileFindings findings;
    const auto text = utf8_of_tag_file(bytes, encoding, findings);
    EXPECT_EQ(text.has_value(), findings.faults().empty());
    return text.value_or("refused");
  };
  using std::string_view_literals::operator""sv;
  EXPECT_EQ(converted("\xc3\xa9", "utf-8"), "\xc3\xa9");
  EXPECT_EQ(converted("\xef\xbb\xbfyes", "UTF-8"), "yes");
  EXPECT_EQ(converted("\xe9", "ISO-8859-1"), "\xc3\xa9");
  EXPECT_EQ(converted("\0A\0\xe9"sv, "UTF-16BE"), "A\xc3\xa9");
  EXPECT_EQ(converted("A\0\xe9\0"sv, "UTF-16LE"), "A\xc3\xa9");
  EXPECT_EQ(converted("\xff\xfe"
                      "A\0"sv,
                      "UTF-16"),
            "A");
  EXPECT_EQ(converted("\xfe\xff\0A"sv, "UTF-16"), "A");
  EXPECT_EQ(converted("\xd8\x3d\xde\x00"sv, "UTF-16BE"), "\xf0\x9f\x98\x80");
  for (const auto bad :
       {"\xff"sv, "\xc3"sv, "\xc0\x80"sv, "\xed\xa0\x80"sv, "\xf4\x90\x80\x80"sv}) {
    EXPECT_EQ(converted(bad, "UTF-8"), "refused");
  }
  for (const auto bad : {"A"sv, "\xd8\x3d"sv, "\xde\x00"sv, "\xd8\x3d\0A"sv}) {
    EXPECT_EQ(converted(bad, "UTF-16BE"), "refused");
  }
  EXPECT_EQ(converted("A", "EBCDIC"), "refused");
}

}  // namespace tag_files_test
}  // namespace raystage::store
