// SPDX-License-Identifier: Apache-2.0
// Matroska files as FFmpeg and MKVToolNix read them.
#include "exports/matroska_movie.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "testing/exports/export_test_data.h"

namespace raystage::exports::matroska_movie_test {
namespace {

using ::testing::ContainsRegex;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::lines_of;
using ::testing::Not;
using testing::output_of_program;

std::vector<std::byte> small_jpeg(int seed) {
  return store::encode_jpeg(testing::make(testing::Kind::kMixed, 16, 16, seed), {});
}

MatroskaDescription description(int tracks) {
  MatroskaDescription result;
  result.title = "test";
  result.epoch_utc = 1'767'225'600 * kNanosecondsPerSecond;
  for (int i = 0; i < tracks; ++i) result.tracks.push_back({"cam" + std::to_string(i), 16, 16});
  return result;
}

TEST(MatroskaMovie, TimesAreExactInEveryTrack) {
  const testing::TestFolder folder;
  const auto file = folder.path() / "a.mkv";
  // Equal times, blocks in one cluster (up to 32767 ns), and the largest time.
  const std::vector<std::pair<int, Nanoseconds>> frames{{0, 0},
                                                        {1, 0},
                                                        {2, 1},
                                                        {1, 32'767},
                                                        {2, 32'768},
                                                        {0, 1'000'007},
                                                        {1, 86'400'000'000'123},
                                                        {0, MatroskaMovie::kMaxTime}};
  {
    MatroskaMovie movie(file, description(3));
    int seed = 0;
    for (const auto& [track, time] : frames) movie.append(track, time, small_jpeg(++seed));
    EXPECT_FALSE(std::filesystem::exists(file));
    movie.close();
  }
  for (int track = 0; track < 3; ++track) {
    std::vector<std::string> expected;
    for (const auto& [of, time] : frames) {
      if (of == track) expected.push_back(std::to_string(time));
    }
    EXPECT_EQ(lines_of(output_of_program({"ffprobe", "-v", "error", "-select_streams",
                                          std::to_string(track), "-show_entries", "packet=pts",
                                          "-of", "csv=p=0", file.string()})),
              expected);
  }
  EXPECT_THAT(lines_of(output_of_program({"ffprobe", "-v", "error", "-count_frames",
                                          "-show_entries", "stream=nb_read_frames,time_base", "-of",
                                          "csv=p=0", file.string()})),
              ElementsAre("1/1000000000,3", "1/1000000000,3", "1/1000000000,2"));
}

TEST(MatroskaMovie, HundredsOfTracksAreRead) {
  const testing::TestFolder folder;
  const auto file = folder.path() / "many.mkv";
  constexpr int kTracks = 300;  // track numbers of one and of two bytes
  MatroskaDescription all = description(kTracks);
  all.attachments.push_back({"rig.json", "application/json", "{}"});
  MatroskaMovie movie(file, all);
  for (int frame = 0; frame < 2; ++frame) {
    for (int track = 0; track < kTracks; ++track) {
      movie.append(track, frame * 1'000'000 + track, small_jpeg(track));
    }
  }
  movie.close();
  const auto read = nlohmann::json::parse(output_of_program({"mkvmerge", "-J", file.string()}));
  EXPECT_TRUE(read["container"]["recognized"].get<bool>());
  EXPECT_TRUE(read["errors"].empty()) << read["errors"];
  EXPECT_TRUE(read["warnings"].empty()) << read["warnings"];
  ASSERT_EQ(read["tracks"].size(), kTracks);
  EXPECT_EQ(read["tracks"][299]["properties"]["track_name"], "cam299");
  EXPECT_EQ(read["tracks"][299]["properties"]["minimum_timestamp"], 299);
  EXPECT_EQ(read["attachments"][0]["file_name"], "rig.json");
  const auto counts = lines_of(output_of_program(
      {"ffprobe", "-v", "error", "-select_streams", "v:299", "-count_packets", "-show_entries",
       "stream=nb_read_packets", "-of", "csv=p=0", file.string()}));
  EXPECT_THAT(counts, ElementsAre("2"));
  // FFmpeg and mpv report elements that they cannot parse.
  const std::string said =
      output_of_program({"ffmpeg", "-nostdin", "-v", "warning", "-i", file.string(), "-map",
                         "0:v:299", "-c", "copy", "-f", "null", "-"}) +
      output_of_program(
          {"mpv", "--no-config", "--vo=null", "--vid=300", "--frames=1", file.string()});
  EXPECT_THAT(said, Not(ContainsRegex("EBML|pars|Duplicate|invalid")));
  EXPECT_THAT(said, HasSubstr("VO: [null] 16x16"));
}

TEST(MatroskaMovie, NothingIsThereBeforeItIsClosed) {
  const testing::TestFolder folder;
  {
    MatroskaMovie movie(folder.path() / "a.mkv", description(1));
    movie.append(0, 5, small_jpeg(1));
    EXPECT_THROW(movie.append(0, 4, small_jpeg(1)), Error);
    EXPECT_THROW(movie.append(0, MatroskaMovie::kMaxTime + 1, small_jpeg(1)), Error);
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
  EXPECT_THROW(MatroskaMovie(folder.path() / "a.mkv", description(0)), Error);
  EXPECT_THROW(MatroskaMovie(folder.path() / "a.mkv", description(MatroskaMovie::kMaxTracks + 1)),
               Error);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace raystage::exports::matroska_movie_test
