// SPDX-License-Identifier: Apache-2.0
#include "farm/path_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "base/error.h"
#include "testing/farm/test_job.h"
#include "testing/test_folder.h"

namespace raystage::farm {
namespace {

TEST(PathMap, MapsWholeNamesByTheFirstRule) {
  const std::vector<PathMappingRule> rules{parse_path_rule("/mnt/show/=/net/show"),
                                           parse_path_rule("/mnt=/m")};
  EXPECT_EQ(map_path("/mnt/show/a b/x", rules), "/net/show/a b/x");
  EXPECT_EQ(map_path("/mnt/show", rules), "/net/show");
  EXPECT_EQ(map_path("/mnt/showreel/x", rules), "/m/showreel/x");
  EXPECT_EQ(map_path("/other", rules), "/other");
  EXPECT_EQ(map_path("", rules), "");
  for (const char* wrong : {"", "a=b", "/a", "/a=b", "=/b"}) {
    EXPECT_THROW(parse_path_rule(wrong), Error) << wrong;
  }
}

TEST(PathMap, ReachesEveryPathOfAJobAndAShot) {
  schemas::FarmJobDocument job = testing::make_small_job();
  const std::vector<PathMappingRule> rules{{"/take", "/net/take"}, {"/show", "/net/show"}};
  job.pinned = {"/take/depth/a/b.zst"};
  map_paths(job, rules);
  EXPECT_EQ(job.instants[0].file, "/net/take/depth/a/b.zst");
  EXPECT_EQ(job.pinned[0], "/net/take/depth/a/b.zst");
  EXPECT_EQ(job.shot_folder, "/net/show");
  EXPECT_EQ(map_shot_paths(R"({"a": ["/take/1", "take"], "b": 1.5})", "x", rules),
            "{\n  \"a\": [\"/net/take/1\", \"take\"],\n  \"b\": 1.5\n}\n");
}

TEST(PathMap, KnowsWhichHostsNamesApply) {
  const testing::TestFolder folder;
  schemas::FarmJobDocument job = testing::make_small_job();
  job.paths = {{"/mnt/show", "/net/show"}};
  job.folder = folder.path().string();
  EXPECT_TRUE(local_path_rules(job, folder.path() / ".").empty()) << "the nodes' names";
  job.folder = "/net/show/s.farm/job-0001";
  const auto rules = local_path_rules(job, folder.path());
  ASSERT_EQ(rules.size(), 1U);
  EXPECT_EQ(map_path("/net/show/x", rules), "/mnt/show/x");
}

TEST(PathMap, ReadsASessionsRules) {
  const testing::TestFolder folder;
  const auto file = folder.path() / "rules.json";
  write_file_atomically(file, R"({"version": "pathmapping-1.0", "path_mapping_rules": [
    {"source_path_format": "WINDOWS", "source_path": "Z:\\x", "destination_path": "/x"},
    {"source_path_format": "POSIX", "source_path": "/a", "destination_path": "/b"}]})");
  const auto rules = read_path_mapping(file);
  ASSERT_EQ(rules.size(), 1U);
  EXPECT_EQ(map_path("/a/c", rules), "/b/c");
  write_file_atomically(file, R"({"version": "pathmapping-1.0"})");
  EXPECT_TRUE(read_path_mapping(file).empty());
  for (const char* wrong :
       {"[]", "{}", R"({"version": "pathmapping-1.0", "path_mapping_rules": 3})",
        R"({"version": "pathmapping-1.0", "path_mapping_rules": [{}]})"}) {
    write_file_atomically(file, wrong);
    EXPECT_THROW(read_path_mapping(file), Error) << wrong;
  }
}

}  // namespace
}  // namespace raystage::farm
