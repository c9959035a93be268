// SPDX-License-Identifier: Apache-2.0
// Whole commands: packed takes, read by other commands and by programs that are not ours.
#include <algorithm>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "store/take.h"
#include "testing/cli/render_command_test_data.h"

namespace raystage::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

/// The take of RenderCommandTest, packed as `packed`.
class PackCommandTest : public RenderCommandTest {
 protected:
  CommandResult pack(const std::string& options = "") const {
    return run_raystage("pack " + quoted("take") + " -o " + quoted("packed") + " -q " + options);
  }
};

TEST_F(PackCommandTest, PicturesOfPackedTakesAreTheSameByteForByte) {
  const CommandResult packed = pack("--json");
  ASSERT_EQ(packed.exit_code, 0) << packed.output;
  const auto json = nlohmann::json::parse(packed.output);
  EXPECT_EQ(json["frames"], 18);
  EXPECT_EQ(json["packed"], 18);
  EXPECT_LT(json["bytes_after"], json["bytes_before"]);
  EXPECT_EQ(json["cameras"].size(), 9);

  ASSERT_EQ(render("a").exit_code, 0);
  fs::rename(path("take"), path("source"));
  fs::rename(path("packed"), path("take"));
  const CommandResult rendered = render("b");
  ASSERT_EQ(rendered.exit_code, 0) << rendered.output;
  EXPECT_EQ(files_under(path("a")).size(), kFrames);
  EXPECT_THAT(different_files(path("a"), path("b")), ::testing::IsEmpty());

  EXPECT_EQ(run_raystage("verify " + quoted("take") + " -q").exit_code, 0);
  EXPECT_EQ(run_raystage("verify " + quoted("take") + " --decode -q").exit_code, 0);
  EXPECT_THAT(run_raystage("info " + quoted("take")).output,
              HasSubstr("Packed      JPEG XL: 18 frames are packed, 0 are JPEG"));
  EXPECT_THAT(run_raystage("info " + quoted("source")).output,
              ::testing::Not(HasSubstr("Packed      ")));

  const CommandResult again =
      run_raystage("unpack " + quoted("take") + " -o " + quoted("again") + " -q");
  ASSERT_EQ(again.exit_code, 0) << again.output;
  EXPECT_THAT(different_files(path("again"), path("source")), ::testing::IsEmpty());
}

TEST_F(PackCommandTest, BadUsageHasExitCode2) {
  EXPECT_EQ(run_raystage("pack " + quoted("take") + " -o " + quoted("take") + " -q").exit_code, 2);
  EXPECT_EQ(run_raystage("pack " + quoted("none") + " -o " + quoted("a") + " -q").exit_code, 2);
  EXPECT_EQ(run_raystage("pack " + quoted("take") + " -o " + quoted("a") + " --effort 0").exit_code,
            2);
  const CommandResult unpacked =
      run_raystage("unpack " + quoted("take") + " -o " + quoted("a") + " -q");
  EXPECT_EQ(unpacked.exit_code, 2);
  EXPECT_THAT(unpacked.output, HasSubstr("not packed"));
}

/// Splits what mkvextract wrote into frames by the sizes that mkvinfo lists, as
/// docs/formats/archive.md describes, and returns each JPEG with djxl.
TEST_F(PackCommandTest, OtherProgramsReturnTheJpegs) {
  for (const char* program : {"mkvextract", "mkvinfo", "djxl"}) {
    ASSERT_EQ(std::system((std::string("command -v ") + program + " > /dev/null").c_str()), 0)
        << program << " is not installed: run scripts/install_packages.sh";
  }
  ASSERT_EQ(pack().exit_code, 0);
  const store::Take source(path("take"));
  const std::string id = source.document().cameras[4].id;
  // As docs/formats/archive.md describes it.
  write_file_atomically(path("frames.sh"), R"sh(
cd "$1" && mkvextract "$2" tracks --raw 0:frames > /dev/null || exit 1
n=0; at=0
for size in $(mkvinfo -s "$2" | sed -n 's/.* size \([0-9]*\), .*/\1/p'); do
  tail -c +$((at + 1)) frames | head -c $size > $n.jxl
  djxl $n.jxl $n.jpg 2> /dev/null || exit 1
  at=$((at + size)); n=$((n + 1))
done
)sh");
  const std::string script =
      "sh " + quoted("frames.sh") + " " + quoted("packed") + " archive/" + id + ".mkv";
  ASSERT_EQ(std::system(script.c_str()), 0) << script;
  for (int frame = 0; frame < kFrames; ++frame) {
    const std::string jpeg = read_file(path("packed") / (std::to_string(frame) + ".jpg"));
    EXPECT_TRUE(std::ranges::equal(std::as_bytes(std::span(jpeg)), source.archive(4).jpeg(frame)));
  }
}

}  // namespace
}  // namespace raystage::testing
