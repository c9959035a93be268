// SPDX-License-Identifier: Apache-2.0
// Measures the stages of a composited frame of 1920x1080 against the lower bound of the library. A
// mesh of a million triangles is compared with Embree alone, merging with copying, EXR files with
// OpenEXR alone. Light fields: methods_bench.
#include <benchmark/benchmark.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <numbers>

#include "base/parallel.h"
#include "compose/exr/exr_file.h"
#include "compose/layers/merge.h"
#include "testing/compose/test_meshes.h"
#include "tests/bench/openexr_encoding.h"
#include "tests/bench/run_benchmarks.h"

namespace raystage {
namespace {

constexpr int kWidth = 1920, kHeight = 1080, kSamples = 4, kPerSide = 2, kThreads = 2;
constexpr std::size_t kPixels = std::size_t{kWidth} * kHeight;

/// A mesh of 1,000,000 triangles that fills most of the picture, shaded by one light.
class Scene {
 public:
  Scene() : mesh_(bumpy_ball(), "ball") {
    scene_.meshes.push_back(testing::make_instance(mesh_, {0, 0, -3}, 0.8));
    scene_.lights.ambient.setConstant(0.2F);
    compose::DirectLight light;
    light.towards = Eigen::Vector3d(0.4, 1, 0.5).normalized();
    scene_.lights.direct.push_back(light);
    camera_ = render::virtual_camera_with_fov(kWidth, kHeight, 50 * std::numbers::pi / 180, {});
  }
  const compose::GeometryScene& scene() const { return scene_; }
  const render::VirtualCamera& camera() const { return camera_; }
  const compose::EmbreeMesh& mesh() const { return mesh_; }

 private:
  static compose::Mesh bumpy_ball() {
    compose::Mesh mesh =
        testing::ball(1, testing::make_material(compose::Material::Kind::kDiffuse, 0.7F), 500);
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
      const Eigen::Vector3d& p = mesh.positions[i];
      mesh.positions[i] =
          p * (1 + 0.03 * std::sin(9 * std::acos(p.y())) * std::sin(11 * std::atan2(p.z(), p.x())));
    }
    mesh.normals.clear();
    return mesh;
  }
  compose::EmbreeMesh mesh_;
  compose::GeometryScene scene_;
  render::VirtualCamera camera_;
};

const Scene& scene() {
  static const Scene one;
  return one;
}

const compose::LayerImage& mesh_image() {
  static const compose::LayerImage image =
      compose::render_geometry(scene().scene(), 0, scene().camera(), kSamples);
  return image;
}

/// Returns a layer like a light field on a plane behind half of the mesh: smooth with fine noise.
const compose::LayerImage& light_field_image() {
  static const compose::LayerImage image = [] {
    compose::LayerImage result = compose::transparent_layer_image(kWidth, kHeight);
    for (std::size_t i = 0; i < kPixels; ++i) {
      const std::size_t row = i / kWidth, column = i % kWidth;
      const auto x = static_cast<float>(column), y = static_cast<float>(row);
      for (std::size_t c = 0; c < 3; ++c) {
        result.rgba[4 * i + c] = 0.3F + 0.2F * std::sin(0.01F * x + 0.02F * y) +
                                 0.02F * std::sin(7.1F * x + 3.7F * y + static_cast<float>(c));
      }
      result.rgba[4 * i + 3] = 1;
      result.z[i] = 3 + 2e-4F * x + 1e-4F * y;  // an oblique focal plane
    }
    result.aovs.push_back({"lf", {"coverage"}, false, 0, {}});
    result.aovs.back().values.assign(kPixels, 1.0F);
    return result;
  }();
  return image;
}

const compose::LayerImage& merged_image() {
  static const compose::LayerImage image = compose::merge(
      std::vector<compose::MergedLayer>{{&light_field_image(), false}, {&mesh_image(), false}},
      compose::MergeOrder::kDepth);
  return image;
}

tbb::global_control threads(int count) {
  return {tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(count)};
}

void OurGeometry(benchmark::State& state) {
  const auto limit = threads(kThreads);
  scene();  // builds it before the timing
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        compose::render_geometry(scene().scene(), 0, scene().camera(), kSamples));
  }
}

/// Generates and traces only camera rays and a shadow ray from each hit.
std::int64_t trace_rows(RTCScene mesh, int first_row, int last_row) {
  constexpr int kPacket = 16;
  const Eigen::Vector3f light = scene().scene().lights.direct[0].towards.cast<float>().normalized();
  const auto f = static_cast<float>(scene().camera().intrinsics.fx);
  std::int64_t rays = 0;
  for (int y = first_row; y < last_row; ++y) {
    for (int x = 0; x < kWidth; x += kPacket / kSamples) {
      alignas(64) RTCRayHit16 packet{};
      alignas(64) std::array<int, kPacket> valid{};
      for (int i = 0; i < kPacket; ++i) {
        const int pixel = i / kSamples, sample = i % kSamples;
        const int down = sample / kPerSide, right = sample % kPerSide;
        const Eigen::Vector3f direction =
            Eigen::Vector3f(
                (static_cast<float>(x + pixel) + 0.25F + 0.5F * static_cast<float>(right) -
                 kWidth / 2.0F) /
                    f,
                (kHeight / 2.0F - static_cast<float>(y) - 0.25F - 0.5F * static_cast<float>(down)) /
                    f,
                -1)
                .normalized();
        packet.ray.org_z[i] = 3 / 0.8F;
        packet.ray.dir_x[i] = direction.x();
        packet.ray.dir_y[i] = direction.y();
        packet.ray.dir_z[i] = direction.z();
        packet.ray.tfar[i] = 1e9F;
        packet.ray.mask[i] = ~0U;
        packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
        valid[i] = -1;
      }
      RTCIntersectContext context;
      rtcInitIntersectContext(&context);
      context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
      rtcIntersect16(valid.data(), mesh, &context, &packet);
      rays += kPacket;
      int shadows = 0;
      for (int i = 0; i < kPacket; ++i) {
        const bool is_hit = packet.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
        const bool faces = packet.hit.Ng_x[i] * light.x() + packet.hit.Ng_y[i] * light.y() +
                               packet.hit.Ng_z[i] * light.z() !=
                           0;
        valid[i] = is_hit && faces ? -1 : 0;
        if (!is_hit) continue;
        ++shadows;
        packet.ray.org_x[i] += packet.ray.tfar[i] * packet.ray.dir_x[i];
        packet.ray.org_y[i] += packet.ray.tfar[i] * packet.ray.dir_y[i];
        packet.ray.org_z[i] += packet.ray.tfar[i] * packet.ray.dir_z[i];
        packet.ray.tnear[i] = 1e-4F;
        packet.ray.tfar[i] = 1e9F;
        packet.ray.dir_x[i] = light.x();
        packet.ray.dir_y[i] = light.y();
        packet.ray.dir_z[i] = light.z();
      }
      if (shadows > 0) rtcOccluded16(valid.data(), mesh, &context, &packet.ray);
      rays += shadows;
    }
  }
  return rays;
}

void EmbreeAlone(benchmark::State& state) {
  const auto limit = threads(kThreads);
  scene();
  std::int64_t rays = 0;
  for (auto _ : state) {
    std::atomic<std::int64_t> traced = 0;
    parallel_for(0, kHeight / 2, [&](int task) {
      traced += trace_rows(scene().mesh().embree(), 2 * task, 2 * task + 2);
    });
    rays += traced;
  }
  state.counters["rays"] =
      benchmark::Counter(static_cast<double>(rays), benchmark::Counter::kIsRate);
}

void OurMerge(benchmark::State& state) {
  const auto limit = threads(kThreads);
  const std::vector<compose::MergedLayer> layers{{&light_field_image(), false},
                                                 {&mesh_image(), false}};
  for (auto _ : state)
    benchmark::DoNotOptimize(compose::merge(layers, compose::MergeOrder::kDepth));
}

/// Copies the bytes that merging reads and writes.
void CopyAlone(benchmark::State& state) {
  const auto limit = threads(kThreads);
  std::vector<std::vector<float>> from, to;
  for (const compose::LayerImage* image : {&light_field_image(), &mesh_image()}) {
    from.emplace_back(image->rgba.begin(), image->rgba.end());
    from.emplace_back(image->z.begin(), image->z.end());
    for (const compose::Aov& aov : image->aovs)
      from.emplace_back(aov.values.begin(), aov.values.end());
  }
  for (auto _ : state) {
    to.assign(from.size(), {});
    parallel_for(std::size_t{0}, from.size(), [&](std::size_t i) { to[i] = from[i]; });
    benchmark::DoNotOptimize(to);
  }
}

/// What a file holds.
using Content = const compose::LayerImage& (*)();

void OurEncoding(benchmark::State& state, Content content, const std::string& colours,
                 const std::string& data) {
  const auto limit = threads(1);  // one thread writes a file while others render
  compose::ExrCamera camera;
  camera.view = scene().camera();
  compose::ExrMetadata metadata;
  metadata.compression = colours;
  metadata.data_compression = data;
  const std::vector<compose::ExrView> views{compose::exr_view(content(), "")};
  std::size_t bytes = 0;
  for (auto _ : state) {
    bytes = compose::encode_exr(views, std::vector<compose::ExrCamera>{camera}, metadata).size();
  }
  state.counters["MB"] = static_cast<double>(bytes) * 1e-6;
}

/// Writes by OpenEXR alone: the same parts one after the other, with pixels in OpenEXR's layout.
void OpenExrAlone(benchmark::State& state, Content content, Imf::Compression colours,
                  Imf::Compression data, int zip_level) {
  const testing::OpenExrEncoding encoding(compose::exr_view(content(), "").layers, kWidth, kHeight);
  std::size_t bytes = 0;
  for (auto _ : state) bytes = encoding.write(colours, data, zip_level);
  state.counters["MB"] = static_cast<double>(bytes) * 1e-6;
}

BENCHMARK(OurGeometry)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(EmbreeAlone)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(OurMerge)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(CopyAlone)->Unit(benchmark::kMillisecond)->UseRealTime();
// Colours, depth and coverage of a light field, then all AOVs of a mesh in front of it.
#define RAYSTAGE_ENCODING(function, name, ...)                                     \
  BENCHMARK_CAPTURE(function, light_field_##name, &light_field_image, __VA_ARGS__) \
      ->Unit(benchmark::kMillisecond)                                              \
      ->MeasureProcessCPUTime();                                                   \
  BENCHMARK_CAPTURE(function, all_##name, &merged_image, __VA_ARGS__)              \
      ->Unit(benchmark::kMillisecond)                                              \
      ->MeasureProcessCPUTime()
RAYSTAGE_ENCODING(OurEncoding, zip, "zip", "zip");
RAYSTAGE_ENCODING(OpenExrAlone, zip_4, Imf::ZIP_COMPRESSION, Imf::ZIP_COMPRESSION, 4);
RAYSTAGE_ENCODING(OpenExrAlone, zip_1, Imf::ZIP_COMPRESSION, Imf::ZIP_COMPRESSION, 1);
RAYSTAGE_ENCODING(OurEncoding, zips, "zips", "zips");
RAYSTAGE_ENCODING(OpenExrAlone, zips_4, Imf::ZIPS_COMPRESSION, Imf::ZIPS_COMPRESSION, 4);
RAYSTAGE_ENCODING(OpenExrAlone, zips_1, Imf::ZIPS_COMPRESSION, Imf::ZIPS_COMPRESSION, 1);
RAYSTAGE_ENCODING(OurEncoding, none, "none", "none");
RAYSTAGE_ENCODING(OurEncoding, piz_zip, "piz", "zip");
RAYSTAGE_ENCODING(OurEncoding, piz, "piz", "piz");
RAYSTAGE_ENCODING(OpenExrAlone, piz, Imf::PIZ_COMPRESSION, Imf::PIZ_COMPRESSION, 4);
RAYSTAGE_ENCODING(OurEncoding, piz_rle, "piz", "rle");
RAYSTAGE_ENCODING(OpenExrAlone, rle, Imf::RLE_COMPRESSION, Imf::RLE_COMPRESSION, 4);
#undef RAYSTAGE_ENCODING

}  // namespace
}  // namespace raystage

int main(int argc, char** argv) { return raystage::run_benchmarks(argc, argv); }
