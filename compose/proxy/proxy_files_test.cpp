// SPDX-License-Identifier: Apache-2.0
#include "compose/proxy/proxy_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <nlohmann/json.hpp>

#include "store/jpeg/decode.h"

namespace raystage::compose {
namespace {

template <class T>
T value_at(const std::string& bytes, std::size_t at) {
  T value{};
  std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

TEST(ProxyFiles, PlyHasItsPoints) {
  PointCloud cloud;
  cloud.points = {{{1, 2, 3}, {4, 5, 6}}, {{-1, 0, 0.5F}, {255, 0, 1}}};
  const std::string file = format_ply(cloud);
  EXPECT_THAT(file, ::testing::StartsWith("ply\nformat binary_little_endian 1.0\n"));
  EXPECT_THAT(file, ::testing::HasSubstr("element vertex 2\n"));
  const std::size_t at = file.find("end_header\n") + 11;
  ASSERT_EQ(file.size(), at + 2 * 15);
  EXPECT_EQ(value_at<float>(file, at + 8), 3);
  EXPECT_EQ(value_at<std::uint8_t>(file, at + 14), 6);
  EXPECT_EQ(value_at<float>(file, at + 15 + 8), 0.5F);
}

TEST(ProxyFiles, PlyIsPreciseFarFromTheOrigin) {
  PointCloud cloud;
  cloud.origin = {456'789, 210, -5'000'000};
  cloud.points = {{{1, 2, 3}, {4, 5, 6}}, {{0.25F, 0, 0.001F}, {255, 0, 1}}};
  const std::string file = format_ply(cloud);
  EXPECT_THAT(file, ::testing::HasSubstr("property double z\nproperty uchar red\n"));
  const std::size_t at = file.find("end_header\n") + 11;
  ASSERT_EQ(file.size(), at + 2 * 27);
  EXPECT_EQ(value_at<std::uint8_t>(file, at + 26), 6);
  EXPECT_EQ(value_at<double>(file, at + 27), 456'789.25);
  EXPECT_NEAR(value_at<double>(file, at + 27 + 16), -4'999'999.999, 1e-9);
}

TEST(ProxyFiles, GlbHasItsMeshAndTexture) {
  ProxyMesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 2, -1}};
  mesh.texture_coordinates = {{0, 0}, {1, 0}, {0, 1}};
  mesh.triangles = {{0, 1, 2}};
  mesh.texture = store::RgbImage(5, 3);
  const std::string file = format_glb(mesh, "scene");
  EXPECT_EQ(file.substr(0, 4), "glTF");
  EXPECT_EQ(value_at<std::uint32_t>(file, 4), 2U);
  EXPECT_EQ(value_at<std::uint32_t>(file, 8), file.size());
  const auto json_bytes = value_at<std::uint32_t>(file, 12);
  EXPECT_EQ(json_bytes % 4, 0U);
  EXPECT_EQ(file.substr(16, 4), "JSON");
  const auto document = nlohmann::json::parse(file.substr(20, json_bytes));
  const std::size_t binary = 20 + json_bytes + 8;
  EXPECT_EQ(file.substr(binary - 4, 4), std::string("BIN\0", 4));
  const auto view_of = [&](const nlohmann::json& index) {
    const auto& view = document["bufferViews"][index.get<std::size_t>()];
    return file.substr(binary + view["byteOffset"].get<std::size_t>(), view["byteLength"]);
  };
  const auto& position = document["accessors"][0];
  EXPECT_EQ(position["max"], (nlohmann::json{1, 2, 0}));
  EXPECT_EQ(value_at<float>(view_of(position["bufferView"]), 4 * 7), 2);
  EXPECT_EQ(value_at<std::uint32_t>(view_of(document["accessors"][2]["bufferView"]), 8), 2U);
  const std::string jpeg = view_of(document["images"][0]["bufferView"]);
  const store::RgbImage texture =
      store::JpegDecoder().decode(std::as_bytes(std::span(jpeg)), "texture");
  EXPECT_EQ(texture.width, 5);
  EXPECT_EQ(texture.height, 3);
  EXPECT_FALSE(document["nodes"][0].contains("translation"));
  mesh.origin = {456'789, 210, -5'000'000};
  const std::string far = format_glb(mesh, "scene");
  const auto moved = nlohmann::json::parse(far.substr(20, value_at<std::uint32_t>(far, 12)));
  EXPECT_EQ(moved["nodes"][0]["translation"], (nlohmann::json{456'789, 210, -5'000'000}));
  EXPECT_EQ(moved["accessors"], document["accessors"]);
}

}  // namespace
}  // namespace raystage::compose
