// SPDX-License-Identifier: Apache-2.0
// Bags that are valid, valid with a warning, and not valid. The kinds of cases are those of the
// BagIt conformance suite of the Library of Congress; the bags are made here.
#include "store/bagit/check_bag.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <functional>
#include <ostream>
#include <string>

#include "base/error.h"
#include "testing/store/bag_test_data.h"

namespace raystage::store {
namespace check_bag_test {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using testing::TestBag;

BagReport checked(const TestBag& bag, BagCheckLevel level = BagCheckLevel::kChecksums) {
  BagCheckOptions options;
  options.level = level;
  return check_bag(bag.path(), options);
}

std::string text_of(const std::vector<BagProblem>& problems) {
  std::string text;
  for (const BagProblem& problem : problems) text += problem.file + ": " + problem.what + "\n";
  return text;
}

/// Two payload files, manifests of these algorithms, and information.
void fill(const TestBag& bag, const std::string& version = "1.0",
          const std::vector<std::string>& algorithms = {"sha512"}) {
  bag.declare(version);
  bag.write("data/hello.txt", "hello\n");
  bag.write("data/deep/er/empty", "");
  for (const std::string& algorithm : algorithms) bag.write_manifest(algorithm);
  const bool is_old = version < "0.96";
  if (!is_old) bag.write_info("Contact-Name: A\nContact-Name: B\n");
  if (is_old) bag.write("package-info.txt", "Contact-Name: A\nPayload-Oxum: 6.2\n");
  for (const std::string& algorithm : algorithms) bag.write_tag_manifest(algorithm);
}

std::string utf16(std::string_view text) {
  std::string bytes;
  for (const char c : text) bytes += std::string(1, '\0') + c;
  return bytes;
}

enum class Verdict { kValid, kWarning, kInvalid };
struct Case {
  const char* name;
  Verdict verdict;
  std::function<void(const TestBag&)> make;
};
std::ostream& operator<<(std::ostream& stream, const Case& c) { return stream << c.name; }

const std::vector<Case>& cases() {
  using V = Verdict;
  static const std::vector<Case> all{
      {"Version093", V::kValid, [](const TestBag& b) { fill(b, "0.93", {"md5"}); }},
      {"Version094", V::kValid, [](const TestBag& b) { fill(b, "0.94", {"md5"}); }},
      {"Version095", V::kValid, [](const TestBag& b) { fill(b, "0.95", {"md5"}); }},
      {"Version096", V::kValid, [](const TestBag& b) { fill(b, "0.96", {"sha1"}); }},
      {"Version097", V::kValid, [](const TestBag& b) { fill(b, "0.97", {"md5"}); }},
      {"Version10", V::kValid, [](const TestBag& b) { fill(b); }},
      {"Md5", V::kValid, [](const TestBag& b) { fill(b, "1.0", {"md5"}); }},
      {"Sha1", V::kValid, [](const TestBag& b) { fill(b, "1.0", {"sha1"}); }},
      {"Sha224", V::kValid, [](const TestBag& b) { fill(b, "1.0", {"sha224"}); }},
      {"Sha256", V::kValid, [](const TestBag& b) { fill(b, "1.0", {"sha256"}); }},
      {"Sha384", V::kValid, [](const TestBag& b) { fill(b, "1.0", {"sha384"}); }},
      {"SeveralAlgorithms", V::kValid,
       [](const TestBag& b) {
         fill(b, "1.0", {"md5", "sha256", "sha512"});
       }},
      {"NoInformation", V::kValid,
       [](const TestBag& b) {
         b.declare();
         b.write("data/a", "a");
         b.write_manifest("sha256");
       }},
      {"EmptyPayload", V::kValid,
       [](const TestBag& b) {
         b.declare();
         fs::create_directory(b.path() / "data");
         b.write("manifest-sha256.txt", "");
       }},
      {"TagFoldersThatNoManifestLists", V::kValid,
       [](const TestBag& b) {
         fill(b);
         b.write("more/notes.txt", "unlisted tag files are allowed");
       }},
      {"LineEndsOfAllKinds", V::kValid,
       [](const TestBag& b) {
         b.write("bagit.txt", "BagIt-Version: 1.0\rTag-File-Character-Encoding: UTF-8\r");
         b.write("data/a", "a");
         b.write("data/b", "b");
         const std::string a = testing::digest_of("a", DigestAlgorithm::kMd5) + " data/a";
         const std::string c = testing::digest_of("b", DigestAlgorithm::kMd5) + "\tdata/b";
         b.write("manifest-md5.txt", a + "\r\n" + c + "\r");
       }},
      {"UpperCaseDigests", V::kValid,
       [](const TestBag& b) {
         b.declare();
         b.write("data/a", "a");
         std::string digest = testing::digest_of("a", DigestAlgorithm::kSha256);
         for (char& c : digest) c = static_cast<char>(std::toupper(c));
         b.write("manifest-sha256.txt", digest + "  data/a\n");
       }},
      {"NamesWithLineEndsAndPercent", V::kValid,
       [](const TestBag& b) {
         b.declare();
         for (const char* name : {"data/a\nb", "data/a\rb", "data/100%", "data/%0A"}) {
           b.write(name, name);
         }
         b.write_manifest("sha256");
       }},
      {"NamesOfLinux", V::kValid,
       [](const TestBag& b) {
         b.declare();
         for (const char* name :
              {"data/CON", "data/a:b", "data/a\\b", "data/ lead", "data/trail ", "data/~home",
               "data/.hidden", "data/*", "data/\xc3\xa9", "data/e\xcc\x81", "data/A", "data/a"}) {
           b.write(name, name);
         }
         b.write_manifest("sha256");
       }},
      {"PercentIsLiteralBefore10", V::kValid,
       [](const TestBag& b) {
         b.declare("0.97");
         b.write("data/100%25", "a");
         b.write("manifest-md5.txt",
                 testing::digest_of("a", DigestAlgorithm::kMd5) + "  data/100%25\n");
       }},
      {"Utf16", V::kValid,
       [](const TestBag& b) {
         b.declare("0.97", "UTF-16BE");
         b.write("data/a", "a");
         b.write("manifest-md5.txt",
                 utf16(testing::digest_of("a", DigestAlgorithm::kMd5) + "  data/a\n"));
         b.write("bag-info.txt", utf16("Payload-Oxum: 1.1\n"));
       }},
      {"Latin1", V::kValid,
       [](const TestBag& b) {
         b.declare("0.97", "ISO-8859-1");
         b.write("data/\xc3\xa9", "a");
         b.write("manifest-md5.txt",
                 testing::digest_of("a", DigestAlgorithm::kMd5) + "  data/\xe9\n");
       }},
      {"FetchedFilesThatAreThere", V::kValid,
       [](const TestBag& b) {
         fill(b);
         b.write("fetch.txt", "http://example.org/hello 6 data/hello.txt\n");
         b.write_tag_manifest("sha512");
       }},
      {"FilesInOneOfTwoManifestsBefore10", V::kValid,
       [](const TestBag& b) {
         b.declare("0.97");
         b.write("data/a", "a");
         b.write("data/b", "b");
         b.write("manifest-md5.txt", testing::digest_of("a", DigestAlgorithm::kMd5) + "  data/a\n");
         b.write("manifest-sha1.txt",
                 testing::digest_of("b", DigestAlgorithm::kSha1) + "  data/b\n");
       }},
      {"FoldedInformation", V::kValid,
       [](const TestBag& b) {
         fill(b);
         b.write_info("External-Description: one\n  two\n\tthree\n");
         b.write_tag_manifest("sha512");
       }},

      {"StarsOfMd5sum", V::kWarning,
       [](const TestBag& b) {
         b.declare();
         b.write("data/a", "a");
         b.write("manifest-md5.txt", testing::digest_of("a", DigestAlgorithm::kMd5) + " *data/a\n");
       }},
      {"LeadingDotSlash", V::kWarning,
       [](const TestBag& b) {
         b.declare();
         b.write("data/a", "a");
         b.write("manifest-md5.txt",
                 testing::digest_of("a", DigestAlgorithm::kMd5) + "  ./data/a\n");
       }},
      {"ByteOrderMarkInManifest", V::kWarning,
       [](const TestBag& b) {
         b.declare();
         b.write("data/a", "a");
         b.write("manifest-md5.txt", "\xef\xbb\xbf" + b.manifest(DigestAlgorithm::kMd5));
       }},
      {"SameLineTwiceBefore10", V::kWarning,
       [](const TestBag& b) {
         b.declare("0.97");
         b.write("data/a", "a");
         b.write("manifest-md5.txt",
                 b.manifest(DigestAlgorithm::kMd5) + b.manifest(DigestAlgorithm::kMd5));
       }},
      {"PercentThatIsNotEncoded", V::kWarning,
       [](const TestBag& b) {
         b.declare();
         b.write("data/a%20b", "a");
         b.write("manifest-md5.txt",
                 testing::digest_of("a", DigestAlgorithm::kMd5) + "  data/a%20b\n");
       }},
      {"UnknownAlgorithmNextToAKnownOne", V::kWarning,
       [](const TestBag& b) {
         fill(b);
         b.write("manifest-crc32.txt", "00000000  data/deep/er/empty\n363a3020  data/hello.txt\n");
         b.write_tag_manifest("sha512");
       }},
      {"WhiteSpaceInDeclarationBefore097", V::kWarning,
       [](const TestBag& b) {
         fill(b, "0.96", {"md5"});
         b.write("bagit.txt", "BagIt-Version : 0.96\nTag-File-Character-Encoding: UTF-8\n");
         b.write_tag_manifest("md5");
       }},

      {"NoDeclaration", V::kInvalid,
       [](const TestBag& b) {
         fill(b);
         fs::remove(b.path() / "bagit.txt");
       }},
      {"NoPayloadFolder", V::kInvalid,
       [](const TestBag& b) {
         b.declare();
         b.write("manifest-md5.txt", "");
       }},
      {"NoManifest", V::kInvalid,
       [](const TestBag& b) {
         b.declare();
         b.write("data/a", "a");
       }},
      {"OnlyUnknownAlgorithms", V::kInvalid,
       [](const TestBag& b) {
         b.declare();
         b.write("data/a", "a");
         b.write("manifest-crc32.txt", "e8b7be43  data/a\n");
       }},
      {"ByteOrderMarkInDeclaration", V::kInvalid,
       [](const TestBag& b) {
         b.write("data/a", "a");
         b.write_manifest("md5");
         b.write("bagit.txt",
                 "\xef\xbb\xbf"
                 "BagIt-Version: 1.0\nTag-File-Character-Encoding: UTF-8\n");
       }},
      {"WhiteSpaceInDeclaration", V::kInvalid,
       [](const TestBag& b) {
         b.write("data/a", "a");
         b.write_manifest("md5");
         b.write("bagit.txt", "BagIt-Version : 1.0\nTag-File-Character-Encoding: UTF-8\n");
       }},
      {"UnknownVersion", V::kInvalid,
       [](const TestBag& b) {
         b.declare("0.5");
         b.write("data/a", "a");
         b.write_manifest("md5");
       }},
      {"UnknownEncoding", V::kInvalid,
       [](const TestBag& b) {
         b.declare("1.0", "EBCDIC");
         b.write("data/a", "a");
         b.write_manifest("md5");
       }},
      {"FileThatNoManifestLists", V::kInvalid,
       [](const TestBag& b) {
         fill(b, "1.0", {"sha256"});
         b.write("data/.DS_Store", "x");
       }},
      {"FileOfOnlyOneOfTwoManifests", V::kInvalid,
       [](const TestBag& b) {
         b.declare();
         b.write("data/a", "a");
         b.write_manifest("md5");
         b.write("data/b", "b");
         b.write_manifest("sha256");
       }},
      {"ListedFileIsMissing", V::kInvalid,
       [](const TestBag& b) {
         fill(b);
         fs::remove(b.path() / "data/hello.txt");
       }},
      {"ListedFileIsAFolder", V::kInvalid,
       [](const TestBag& b) {
         fill(b);
         fs::remove(b.path() / "data/hello.txt");
         fs::create_directory(b.path() / "data/hello.txt");
       }},
      {"ListedTagFileIsMissing", V::kInvalid,
       [](const TestBag& b) {
         fill(b);
         fs::remove(b.path() / "bag-info.txt");
       }},
      {"OneDigestOfTwoDiffers", V::kInvalid,
       [](const TestBag& b) {
         fill(b, "1.0", {"md5", "sha256"});
         std::string text = b.read("manifest-md5.txt");
         text[0] = text[0] == '0' ? '1' : '0';
         b.write("manifest-md5.txt", text);
         b.write_tag_manifest("md5");
         b.write_tag_manifest("sha256");
       }},
      {"SamePathTwice", V::kInvalid,
       [](const TestBag& b) {
         b.declare();
         b.write("data/a", "a");
         b.write("manifest-md5.txt",
                 b.manifest(DigestAlgorithm::kMd5) + b.manifest(DigestAlgorithm::kMd5));
       }},
      {"ParentFolders", V::kInvalid,
       [](const TestBag& b) {
         fill(b);
         b.write("manifest-sha512.txt",
                 b.read("manifest-sha512.txt") + std::string(128, 'a') + "  data/../../../etc/a\n");
       }},
      {"AbsolutePath", V::kInvalid,
       [](const TestBag& b) {
         fill(b);
         b.write("manifest-sha512.txt",
                 b.read("manifest-sha512.txt") + std::string(128, 'a') + "  /etc/passwd\n");
       }},
      {"HomeFolder", V::kInvalid,
       [](const TestBag& b) {
         fill(b);
         b.write("manifest-sha512.txt",
                 b.read("manifest-sha512.txt") + std::string(128, 'a') + "  ~/a\n");
       }},
      {"HomeFolderInTagManifest", V::kInvalid,
       [](const TestBag& b) {
         fill(b);
         b.write("tagmanifest-sha512.txt",
                 b.read("tagmanifest-sha512.txt") + std::string(128, 'a') + "  ~root/a\n");
       }},
      {"PayloadManifestListsATagFile", V::kInvalid,
       [](const TestBag& b) {
         b.declare();
         b.write("data/a", "a");
         b.write("manifest-md5.txt",
                 b.manifest(DigestAlgorithm::kMd5) +
                     testing::digest_of(b.read("bagit.txt"), DigestAlgorithm::kMd5) +
                     "  bagit.txt\n");
       }},
      {"TagManifestListsAPayloadFile", V::kInvalid,
       [](const TestBag& b) {
         fill(b);
         b.write("tagmanifest-sha512.txt",
                 b.read("tagmanifest-sha512.txt") + b.manifest(DigestAlgorithm::kSha512));
       }},
      {"TagManifestListsATagManifest", V::kInvalid,
       [](const TestBag& b) {
         fill(b);
         b.write("tagmanifest-md5.txt",
                 b.manifest(DigestAlgorithm::kMd5, false) +
                     testing::digest_of(b.read("tagmanifest-sha512.txt"), DigestAlgorithm::kMd5) +
                     "  tagmanifest-sha512.txt\n");
       }},
      {"TagManifestWithoutThePayloadManifest", V::kInvalid,
       [](const TestBag& b) {
         fill(b);
         b.write(
             "tagmanifest-sha512.txt",
             testing::digest_of(b.read("bagit.txt"), DigestAlgorithm::kSha512) + "  bagit.txt\n");
       }},
      {"FetchedFilesThatAreMissing", V::kInvalid,
       [](const TestBag& b) {
         fill(b);
         b.write("fetch.txt", "http://example.org/hello 6 data/hello.txt\n");
         b.write_tag_manifest("sha512");
         fs::remove(b.path() / "data/hello.txt");
       }},
      {"FetchedFileThatNoManifestLists", V::kInvalid,
       [](const TestBag& b) {
         fill(b);
         b.write("fetch.txt", "http://example.org/x 6 data/x\n");
         b.write_tag_manifest("sha512");
       }},
      {"FetchOutOfTheBag", V::kInvalid,
       [](const TestBag& b) {
         fill(b);
         b.write("fetch.txt", "http://example.org/x 6 ../../x\n");
         b.write_tag_manifest("sha512");
       }},
      {"WrongOxum", V::kInvalid,
       [](const TestBag& b) {
         fill(b);
         b.write("bag-info.txt", "Payload-Oxum: 7.2\n");
         b.write_tag_manifest("sha512");
       }},
      {"OxumTwice", V::kInvalid,
       [](const TestBag& b) {
         fill(b);
         b.write("bag-info.txt", "Payload-Oxum: 6.2\nPayload-Oxum: 6.2\n");
         b.write_tag_manifest("sha512");
       }},
      {"WhiteSpaceBeforeTheColon", V::kInvalid,
       [](const TestBag& b) {
         fill(b);
         b.write_info("Contact-Name : A\n");
         b.write_tag_manifest("sha512");
       }},
      {"LinkInThePayload", V::kInvalid,
       [](const TestBag& b) {
         fill(b);
         fs::remove(b.path() / "data/hello.txt");
         b.write("hello.txt", "hello\n");
         fs::create_symlink("../hello.txt", b.path() / "data/hello.txt");
       }},
      {"LinkAsTheManifest", V::kInvalid,
       [](const TestBag& b) {
         fill(b, "1.0", {"sha256"});
         fs::rename(b.path() / "manifest-sha256.txt", b.path() / "elsewhere");
         fs::create_symlink("elsewhere", b.path() / "manifest-sha256.txt");
       }},
      {"LinkedFolder", V::kInvalid,
       [](const TestBag& b) {
         fill(b);
         fs::rename(b.path() / "data/deep", b.path() / "deep");
         fs::create_symlink("../deep", b.path() / "data/deep");
       }},
      {"Pipe", V::kInvalid,
       [](const TestBag& b) {
         fill(b);
         fs::remove(b.path() / "data/hello.txt");
         ASSERT_EQ(::mkfifo((b.path() / "data/hello.txt").c_str(), 0600), 0);
       }},
  };
  return all;
}

class BagConformance : public ::testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(Cases, BagConformance, ::testing::ValuesIn(cases()),
                         [](const auto& tested) { return std::string(tested.param.name); });

TEST_P(BagConformance, HasItsVerdict) {
  const TestBag bag;
  fs::create_directory(bag.path());
  GetParam().make(bag);
  const BagReport report = checked(bag);
  EXPECT_EQ(report.status, RunStatus::kFinished);
  EXPECT_EQ(report.is_valid(), GetParam().verdict != Verdict::kInvalid) << text_of(report.problems);
  if (GetParam().verdict == Verdict::kValid) {
    EXPECT_THAT(report.warnings, IsEmpty()) << text_of(report.warnings);
  } else if (GetParam().verdict == Verdict::kWarning) {
    EXPECT_THAT(report.warnings, Not(IsEmpty()));
  }
}

TEST(CheckBag, LevelsFindMoreAndMore) {
  const TestBag bag;
  fill(bag);
  bag.write("data/hello.txt", "HELLO\n");
  EXPECT_TRUE(checked(bag, BagCheckLevel::kCompleteness).is_valid());
  EXPECT_EQ(checked(bag).problems.at(0).found_by, BagCheckLevel::kChecksums);
  fs::rename(bag.path() / "data/hello.txt", bag.path() / "data/other.txt");
  EXPECT_TRUE(checked(bag, BagCheckLevel::kQuick).is_valid());
  EXPECT_FALSE(checked(bag, BagCheckLevel::kCompleteness).is_valid());
  bag.write("data/more.txt", "x");
  EXPECT_FALSE(checked(bag, BagCheckLevel::kQuick).is_valid());
}

TEST(CheckBag, AQuickCheckNeedsThePayloadOxum) {
  const TestBag bag;
  bag.declare();
  bag.write("data/a", "a");
  bag.write_manifest("md5");
  EXPECT_FALSE(checked(bag, BagCheckLevel::kQuick).is_valid());
  EXPECT_TRUE(checked(bag, BagCheckLevel::kCompleteness).is_valid());
}

TEST(CheckBag, WhatIsNoBagOrOfALaterVersionIsBadInput) {
  const TestBag bag;
  EXPECT_THROW(checked(bag), Error);
  fs::create_directory(bag.path());
  bag.write("a", "a");
  EXPECT_THROW(checked(bag), Error);
  bag.declare("1.1");
  bag.write("data/a", "a");
  EXPECT_THROW(checked(bag), Error);
}

TEST(CheckBag, NamesAreReportedAsManifestsWriteThem) {
  const TestBag bag;
  fill(bag, "1.0", {"sha256"});
  bag.write("data/a\nb", "x");
  EXPECT_THAT(text_of(checked(bag).problems),
              HasSubstr("data/a%0Ab: no payload manifest lists it"));
}

TEST(CheckBag, ProblemsOfHostileBagsAreLimited) {
  const TestBag bag;
  bag.declare();
  fs::create_directory(bag.path() / "data");
  std::string text;
  for (int i = 0; i < 3000; ++i)
    text += std::string(32, 'a') + "  data/" + std::to_string(i) + "\n";
  bag.write("manifest-md5.txt", text);
  const BagReport report = checked(bag);
  EXPECT_EQ(report.problems.size(), BagReport::kMaxListed);
  EXPECT_EQ(report.omitted_problems, 3000 - BagReport::kMaxListed);
}

TEST(CheckBag, ManifestsAreLimited) {
  const TestBag bag;
  fill(bag);
  const std::string line = std::string(32, 'a') + "  data/hello.txt\n";
  for (int i = 0; i < 31; ++i) bag.write("manifest-x" + std::to_string(i) + ".txt", line);
  EXPECT_THAT(text_of(checked(bag).problems), HasSubstr("another payload manifest lists it"));
  bag.write("manifest-y.txt", line);
  try {
    checked(bag);
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("the bag has 33 files manifest-*.txt"));
  }
}

TEST(CheckBag, TagFilesHaveOneLimitTogether) {
  const TestBag bag;
  bag.declare();
  bag.write("data/a", "a");
  bag.write_manifest("md5");
  const std::string line = std::string(32, 'a') + "  data/a\n";
  bag.write("manifest-x1.txt", line);
  for (const char* const name : {"manifest-x2.txt", "manifest-x3.txt"}) {
    fs::create_hard_link(bag.path() / "manifest-x1.txt", bag.path() / name);
  }
  BagCheckOptions options;
  options.max_tag_bytes = 4 * line.size();
  EXPECT_TRUE(check_bag(bag.path(), options).is_valid());
  --options.max_tag_bytes;
  const BagReport report = check_bag(bag.path(), options);
  ASSERT_EQ(report.problems.size(), 1U) << text_of(report.problems);
  EXPECT_EQ(report.problems[0].file, "manifest-x3.txt");
  EXPECT_THAT(report.problems[0].what, HasSubstr("more than 163 bytes together"));
}

}  // namespace check_bag_test
}  // namespace raystage::store
