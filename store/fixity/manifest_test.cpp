// SPDX-License-Identifier: Apache-2.0
#include "store/fixity/manifest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "base/atomic_file.h"
#include "base/child_process.h"
#include "base/error.h"
#include "store/fixity/sha256.h"
#include "store/fixity/signature.h"
#include "testing/store/take_test_data.h"
#include "testing/test_folder.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const std::string kZeros(64, '0');

/// Examples of FIPS 180-4.
TEST(Sha256, IsThatOfTheStandard) {
  EXPECT_EQ(Sha256().hex(), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  Sha256 hash;
  hash.update(std::as_bytes(std::span(std::string_view("a"))));
  hash.update(std::as_bytes(std::span(std::string_view("bc"))));
  EXPECT_EQ(hash.hex(), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

TEST(ManifestText, ComesBackAsItWas) {
  const Manifest manifest{.take = "a take: of \u00fcs",
                          .epoch_utc = -5,
                          .cameras = 2,
                          .files = {{"archive/a b.mkv", kZeros}, {"take.json", kZeros}}};
  EXPECT_EQ(parse_manifest(manifest_as_text(manifest), "m"), manifest);
}

TEST(ManifestText, WhatLeavesTheTakeOrIsAmbiguousIsRefused) {
  const std::string heading = "# raystage/manifest/1\n# take: t\n# epoch_utc: 0\n# cameras: 1\n";
  const auto fault = [&](const std::string& rest) -> std::string {
    try {
      parse_manifest(heading + rest, "m");
      return "";
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      return error.what();
    }
  };
  EXPECT_EQ(fault(kZeros + "  a\n"), "");
  for (const char* path : {"../a", "/a", "a/../b", "a//b", "./a", "", ".a", "a/.b", "depth/a",
                           "manifest.sha256", "a\\b", "a\tb"}) {
    EXPECT_THAT(fault(kZeros + "  " + path + "\n"), HasSubstr("line 5")) << path;
  }
  EXPECT_THAT(fault(kZeros + "  b\n" + kZeros + "  a\n"), HasSubstr("not sorted"));
  EXPECT_THAT(fault(kZeros + "  a\n" + kZeros + "  a\n"), HasSubstr("listed twice"));
  EXPECT_THAT(fault(kZeros + " a\n"), HasSubstr("SHA-256"));
  EXPECT_THAT(fault(std::string(64, 'G') + "  a\n"), HasSubstr("SHA-256"));
  EXPECT_THAT(fault(kZeros + "  a"), HasSubstr("its end is missing"));
  EXPECT_THROW(parse_manifest("", "m"), Error);
  EXPECT_THROW(parse_manifest("# raystage/manifest/2\n", "m"), Error);
}

class ManifestOfATake : public ::testing::Test {
 protected:
  ManifestOfATake() {
    testing::write_take(take(), {{0, 66'000'000}, {1'000}});
    fs::create_directories(take() / "depth");
    std::ofstream(take() / "depth" / "derived") << "x";
    std::ofstream(take() / ".hidden") << "x";
    const Manifest manifest = make_manifest(Take(take()), {});
    write_file_atomically(take() / kManifestFile, manifest_as_text(manifest));
  }
  fs::path take() const { return folder_.path() / "take"; }
  ManifestReport check() const { return check_manifest(take(), read_manifest(take()), {}); }
  void change(const std::string& name) {
    std::fstream file(take() / name, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(3);
    file.put('\x01');
  }
  testing::TestFolder folder_;
};

TEST_F(ManifestOfATake, ListsEverythingThatIsNotDerived) {
  const ManifestReport report = check();
  EXPECT_TRUE(report.is_intact());
  std::vector<std::string> listed;
  for (const auto& file : report.manifest.files) listed.push_back(file.path);
  EXPECT_EQ(listed, files_of_take(take()));
  EXPECT_THAT(listed, ::testing::Contains("take.json"));
  EXPECT_THAT(listed, ::testing::Not(::testing::Contains("depth/derived")));
  EXPECT_THAT(listed, ::testing::Not(::testing::Contains(".hidden")));
}

/// The reference: another program that reads the file.
TEST_F(ManifestOfATake, Sha256sumAgrees) {
  const ChildResult result = run_child(
      {"sh", "-c", "cd '" + take().string() + "' && sha256sum --strict --check manifest.sha256"});
  EXPECT_EQ(result.exit_code, 0) << result.out;
  EXPECT_THAT(result.out, HasSubstr("take.json: OK"));
}

TEST_F(ManifestOfATake, FindsChangedMissingAndAddedFiles) {
  change("rig.json");
  fs::rename(take() / "take.json", folder_.path() / "elsewhere");
  std::ofstream(take() / "added.txt") << "x";
  const ManifestReport report = check();
  EXPECT_THAT(report.changed, ElementsAre("rig.json"));
  EXPECT_THAT(report.missing, ElementsAre("take.json"));
  EXPECT_THAT(report.unlisted, ElementsAre("added.txt"));
}

TEST_F(ManifestOfATake, LinksAndSpecialFilesAreRefused) {
  std::ofstream(folder_.path() / "outside") << "x";
  fs::create_symlink(folder_.path() / "outside", take() / "link");
  EXPECT_THROW(check(), Error);
  EXPECT_THROW(make_manifest(Take(take()), {}), Error);
  fs::remove(take() / "link");
  fs::remove(take() / kManifestFile);
  EXPECT_THROW(check(), Error);
  fs::create_symlink(folder_.path() / "outside", take() / kManifestFile);
  EXPECT_THROW(check(), Error);
}

TEST_F(ManifestOfATake, CanBeStopped) {
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW(
      check_manifest(take(), read_manifest(take()), {.progress = {}, .stop = stop.get_token()}),
      Error);
}

TEST_F(ManifestOfATake, SignaturesAreCheckedBySshKeygen) {
  const fs::path key = folder_.path() / "key", signers = folder_.path() / "signers";
  ASSERT_EQ(
      run_child({"ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", key.string()}).exit_code, 0);
  std::ofstream(signers) << "archive@example.org " << read_file(key.string() + ".pub");
  const fs::path file = take() / kManifestFile;
  EXPECT_THROW(
      signature_fault(read_file(file), take() / kSignatureFile, {signers, "archive@example.org"}),
      Error);
  sign_file(file, key);
  sign_file(file, key);  // again
  EXPECT_TRUE(fs::exists(take() / kSignatureFile));
  EXPECT_EQ(
      signature_fault(read_file(file), take() / kSignatureFile, {signers, "archive@example.org"}),
      "");
  EXPECT_THAT(
      signature_fault(read_file(file), take() / kSignatureFile, {signers, "somebody@example.org"}),
      HasSubstr("of the manifest, but not by somebody@example.org"));
  EXPECT_TRUE(check().is_intact());  // does not list its signature
  change(kManifestFile);
  EXPECT_THAT(
      signature_fault(read_file(file), take() / kSignatureFile, {signers, "archive@example.org"}),
      ::testing::StartsWith("bad: "));
  EXPECT_THROW(sign_file(file, folder_.path() / "none"), Error);
  // A file of signers that cannot be read says nothing of the signature.
  EXPECT_THROW(signature_fault(read_file(file), key, {folder_.path() / "none", "a"}), Error);
}

}  // namespace
}  // namespace raystage::store
