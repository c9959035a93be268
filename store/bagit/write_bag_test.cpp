// SPDX-License-Identifier: Apache-2.0
#include "store/bagit/write_bag.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "base/atomic_file.h"
#include "base/error.h"
#include "store/bagit/check_bag.h"
#include "store/bagit/file_formats.h"
#include "store/bagit/premis.h"
#include "store/fixity/event_log.h"
#include "store/fixity/manifest.h"
#include "testing/store/take_test_data.h"
#include "testing/test_folder.h"

namespace raystage::store {
namespace write_bag_test {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class WriteBagTest : public ::testing::Test {
 protected:
  WriteBagTest() {
    testing::write_take(path("take"), {{1'000'000, 2'000'000}, {1'500'000}});
    write_file_atomically(path("take") / "100%.txt", "a name with per cent\n");
    for (const char* file :
         {"formats/archive.md", "schemas/take.schema.json", "reader/read_take.py"}) {
      create_folder((path("installed") / file).parent_path());
      write_file_atomically(path("installed") / file, file);
    }
    options_.program = "raystage";
    options_.version = "1.2.3";
    options_.representation = path("installed");
  }
  fs::path path(const std::string& name) const { return folder_.path() / name; }
  BagWriteReport write(const std::string& name = "bag") const {
    return write_bag(Take(path("take")), path(name), options_);
  }
  void append_capture() const {
    schemas::TakeEvent event;
    event.type = "capture";
    event.program = "raystage";
    event.version = "1.2.3";
    ASSERT_TRUE(append_event(path("take"), make_event(path("take"), event)));
  }
  static std::size_t entries_of(const fs::path& folder) {
    return static_cast<std::size_t>(
        std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
  }

  testing::TestFolder folder_;
  BagOptions options_;
};

TEST_F(WriteBagTest, TheBagIsValidAndHoldsTheTakeUnchanged) {
  append_capture();
  options_.info = {{"Source-Organization", "An archive"}};
  const BagWriteReport report = write();
  EXPECT_EQ(report.status, RunStatus::kFinished);
  const BagReport found = check_bag(path("bag"), {});
  EXPECT_TRUE(found.is_valid());
  EXPECT_THAT(found.warnings, IsEmpty());
  EXPECT_EQ(found.payload_files, report.files);
  EXPECT_EQ(std::system(("diff -r '" + path("take").string() + "' '" +
                         (path("bag") / "data").string() + "'")
                            .c_str()),
            0);
  const std::string info = read_file(path("bag") / "bag-info.txt");
  EXPECT_THAT(info, HasSubstr("External-Identifier: x-raystage-take:test/2026-01-01T00:00:00Z\n"));
  EXPECT_THAT(info, HasSubstr("Bag-Software-Agent: raystage 1.2.3\n"));
  EXPECT_THAT(info, HasSubstr("Source-Organization: An archive\n"));
  EXPECT_THAT(read_file(path("bag") / "representation/formats.csv"), HasSubstr("fmt/569"));
  EXPECT_TRUE(fs::exists(path("bag") / "representation/reader/read_take.py"));
}

TEST_F(WriteBagTest, NamesOfArchivesDoNotShiftTheColumnsOfHashes) {
  auto document = schemas::read_take(path("take") / "take.json");
  const std::string name = "archive/c0,0,0,0,dead.mkv";
  fs::rename(path("take") / document.cameras[0].archive, path("take") / name);
  document.cameras[0].archive = name;
  write_file_atomically(path("take") / "take.json", schemas::format_take(document));
  write();
  EXPECT_THAT(read_file(path("bag") / "xxh3/frames.csv"),
              HasSubstr("\"data/" + name + "\",1000000,"));
}

TEST_F(WriteBagTest, CoreutilsFindTheManifestsRight) {
  fs::remove(path("take") / "100%.txt");  // sha256sum does not know BagIt's encoding
  write();
  for (const char* manifest : {"manifest-sha256.txt", "tagmanifest-sha256.txt"}) {
    const std::string command =
        "cd '" + path("bag").string() + "' && sha256sum --check --strict --quiet " + manifest;
    EXPECT_EQ(std::system(command.c_str()), 0) << manifest;
  }
}

TEST_F(WriteBagTest, EventsAreInThePremisDocument) {
  append_capture();
  const BagWriteReport report = write();
  const std::string xml = read_file(path("bag") / "premis.xml");
  EXPECT_THAT(xml, HasSubstr("<premis:eventType>capture</premis:eventType>"));
  EXPECT_THAT(xml, HasSubstr("<premis:eventType>fixity check</premis:eventType>"));
  EXPECT_THAT(xml, HasSubstr("<premis:eventType>information package creation</premis:eventType>"));
  EXPECT_THAT(xml, HasSubstr("<premis:formatRegistryKey>fmt/569</premis:formatRegistryKey>"));
  EXPECT_THAT(xml, HasSubstr("<premis:originalName>100%.txt</premis:originalName>"));
  EXPECT_THAT(xml, HasSubstr("PRONOM: none registered"));
  EXPECT_EQ(report.events.size(), 2);
  // The take's own log is as it was.
  EXPECT_EQ(read_event_log(path("take")).events.size(), 1);
}

TEST_F(WriteBagTest, OcflObjectsHoldTheBag) {
  options_.is_ocfl = true;
  write("object");
  EXPECT_EQ(read_file(path("object") / "0=ocfl_object_1.1"), "ocfl_object_1.1\n");
  EXPECT_TRUE(check_bag(path("object") / "v1/content", {}).is_valid());
  EXPECT_EQ(read_file(path("object") / "inventory.json"),
            read_file(path("object") / "v1/inventory.json"));
  // The sidecar has one space, as OCFL permits; coreutils want two.
  EXPECT_EQ(std::system(("cd '" + path("object").string() +
                         "' && sed 's/ /  /' inventory.json.sha512 | sha512sum --check --quiet")
                            .c_str()),
            0);
}

TEST_F(WriteBagTest, DamagedTakesAreRefusedAndNothingRemains) {
  const std::size_t before = entries_of(folder_.path());
  const fs::path archive = path("take") / "archive/c0.mkv";
  std::string bytes = read_file(archive);
  bytes[bytes.size() / 2] ^= 1;
  write_file_atomically(archive, bytes);
  EXPECT_THROW(write(), Error);
  EXPECT_EQ(entries_of(folder_.path()), before);
}

TEST_F(WriteBagTest, AMissingInstallationIsAnErrorAndNothingRemains) {
  const std::size_t before = entries_of(folder_.path());
  options_.representation = path("nowhere");
  EXPECT_THROW(write(), Error);
  EXPECT_EQ(entries_of(folder_.path()), before);
}

TEST_F(WriteBagTest, TargetsThatExistOrAreInTheTakeAreRefused) {
  write_file_atomically(path("bag"), "mine");
  EXPECT_THROW(write(), Error);
  EXPECT_EQ(read_file(path("bag")), "mine");
  EXPECT_THROW(write("take/bag"), Error);
  fs::create_symlink("nowhere", path("link"));
  EXPECT_THROW(write("link"), Error);
}

TEST_F(WriteBagTest, LinksInTheTakeAreRefused) {
  fs::create_symlink("take.json", path("take") / "link.json");
  EXPECT_THROW(write(), Error);
  fs::remove(path("take") / "link.json");
  fs::create_symlink("take.json", path("take") / kEventLogFile);
  EXPECT_THROW(write(), Error);
  EXPECT_FALSE(fs::exists(path("bag")));
}

TEST_F(WriteBagTest, StoppingLeavesNothing) {
  const std::size_t before = entries_of(folder_.path());
  std::stop_source stop;
  options_.stop = stop.get_token();
  options_.progress = [&](double done) {
    if (done > 0.2) stop.request_stop();
  };
  EXPECT_THROW(write(), Error);
  EXPECT_EQ(entries_of(folder_.path()), before);
}

TEST_F(WriteBagTest, IdentifiersAreUris) {
  for (const char* bad : {"shot 12", "no colon", "1x:a", "urn:", ":a", "urn:a b"}) {
    options_.identifier = bad;
    EXPECT_THROW(write(), Error) << bad;
  }
  EXPECT_FALSE(fs::exists(path("bag")));
  options_.identifier = "ark:/12345/x?form=av1";
  EXPECT_EQ(write().identifier, options_.identifier);
}

TEST(BagInfoElements, MustFitOnALine) {
  EXPECT_NO_THROW(check_bag_info({{"Contact-Name", "A: B"}}));
  for (const BagInfo::Element& bad : std::vector<BagInfo::Element>{{"", "a"},
                                                                   {"a:b", "c"},
                                                                   {" a", "b"},
                                                                   {"a", "b\nc"},
                                                                   {"a\r", "b"},
                                                                   {"a", "\xff"},
                                                                   {"Payload-Oxum", "1.1"},
                                                                   {"Bagging-Date", "today"}}) {
    EXPECT_THROW(check_bag_info({bad}), Error) << bad.label;
  }
}

TEST(Premis, TextsAreEscaped) {
  schemas::TakeEvent event;
  event.type = "a<b>&\"c\"";
  event.note = std::string("zero \0 control \x01 bad \xff end", 26);
  const std::vector<schemas::TakeEvent> events{event};
  const std::string xml = premis_as_xml("x:1", "]]>", {}, events);
  EXPECT_THAT(xml, HasSubstr("a&lt;b&gt;&amp;\"c\""));
  EXPECT_THAT(xml, Not(HasSubstr("\x01")));
  EXPECT_THAT(xml, Not(HasSubstr("\xff")));
  EXPECT_THAT(xml, Not(HasSubstr("]]>")));
}

TEST(FileFormats, FieldsWithSeparatorsAndLineEndsAreQuoted) {
  EXPECT_EQ(csv_field("archive/a.mkv"), "archive/a.mkv");
  EXPECT_EQ(csv_field("a,b"), "\"a,b\"");
  EXPECT_EQ(csv_field("a\"b"), "\"a\"\"b\"");
  EXPECT_EQ(csv_field("a\r\nb"), "\"a\r\nb\"");
}

TEST(FileFormats, AreKnownForFilesOfTakes) {
  EXPECT_EQ(format_of_file("archive/a.mkv").pronom, "fmt/569");
  EXPECT_EQ(format_of_file("recording/node.json").pronom, "fmt/817");
  EXPECT_EQ(format_of_file("archive/a.journal").pronom, "");
  EXPECT_EQ(format_of_file("imported_depth/a/000001.0123456789abcdef.zst").page,
            "formats/depth.md");
  EXPECT_EQ(format_of_file("imported_depth/maps.json").pronom, "fmt/817");
  EXPECT_EQ(format_of_file("timeline.zst").page, "formats/timeline.md");
  EXPECT_THAT(file_formats_as_csv(), HasSubstr("state the version,,none registered"));
  for (const char* codec : {"V_MJPEG", "V_JPEGXL", "V_JPEGXL/PICTURE", "HEVC", "V_AV1"}) {
    EXPECT_THAT(file_formats_as_csv(), HasSubstr(codec));
  }
  EXPECT_THAT(file_formats_as_csv(), HasSubstr("fmt/43"));
  // Commas outside of quotes separate the five fields of a row.
  int commas = 0, rows = 0;
  bool is_quoted = false;
  for (const char c : file_formats_as_csv()) {
    if (c == '"') is_quoted = !is_quoted;
    if (c == ',' && !is_quoted) ++commas;
    if (c == '\n') ++rows;
  }
  EXPECT_EQ(commas, 4 * rows);
}

TEST_F(WriteBagTest, ATakeThatDiffersFromItsManifestIsRefused) {
  write_file_atomically(path("take") / kManifestFile,
                        manifest_as_text(make_manifest(Take(path("take")), {})));
  write();
  const auto refusal = [&] {
    try {
      write("other");
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  write_file_atomically(path("take") / "100%.txt", "changed\n");
  EXPECT_THAT(refusal(), HasSubstr("not as its manifest states, for example 100%.txt"));
  fs::remove(path("take") / "100%.txt");
  EXPECT_THAT(refusal(), HasSubstr("for example 100%.txt"));
  write_file_atomically(path("take") / "100%.txt", "a name with per cent\n");
  write_file_atomically(path("take") / "added.txt", "");
  EXPECT_THAT(refusal(), HasSubstr("for example added.txt"));
  fs::remove(path("take") / "added.txt");
  EXPECT_EQ(refusal(), "accepted");
}

}  // namespace write_bag_test
}  // namespace raystage::store
