// SPDX-License-Identifier: Apache-2.0
// Compares the processor time of encoding the contents of a rendered EXR file with OpenEXR's, in
// turns: colours as halves, depth and measures as floats.
//   exr_encoding_bench FILE.exr...
#include <fmt/format.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <functional>
#include <string>
#include <vector>

#include "base/resources.h"
#include "compose/exr/exr_file.h"
#include "images/exr_reader.h"
#include "tests/bench/openexr_encoding.h"

namespace raystage {
namespace {

/// The layers of a light field's frame.
struct Frame {
  compose::ExrView view;
  int width = 0, height = 0;
  std::vector<images::ExrChannelData> data;
};

Frame read_frame(const std::string& file) {
  Frame frame;
  constexpr images::ExrChannel kColours[] = {{"R"}, {"G"}, {"B"}, {"A"}};
  constexpr images::ExrChannel kDepth[] = {{"Z"}}, kCoverage[] = {{"coverage.V"}};
  constexpr const char* kWhatToDo = "Give a file of raystage render";
  frame.data.push_back(images::read_exr_channels(file, kColours, kWhatToDo));
  frame.data.push_back(images::read_exr_channels(file, kDepth, kWhatToDo));
  frame.data.push_back(images::read_exr_channels(file, kCoverage, kWhatToDo));
  frame.width = frame.data[0].width;
  frame.height = frame.data[0].height;
  frame.view.layers = {{"", {"R", "G", "B", "A"}, true, frame.data[0].values, 0},
                       {"depth", {"Z"}, false, frame.data[1].values, 0},
                       {"lf", {"coverage"}, false, frame.data[2].values, 0}};
  return frame;
}

/// Returns the seconds of processor time that a call takes.
double seconds_of(const std::function<void()>& call) {
  const double before = cpu_seconds();
  call();
  return cpu_seconds() - before;
}

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

void compare(const std::string& file) {
  constexpr int kTurns = 15;
  const Frame frame = read_frame(file);
  const std::array views{frame.view};
  const testing::OpenExrEncoding openexr(frame.view.layers, frame.width, frame.height);
  std::array<compose::ExrCamera, 1> camera;
  camera[0].view = render::virtual_camera_with_fov(frame.width, frame.height, 1, {});
  for (const Imf::Compression compression : {Imf::ZIP_COMPRESSION, Imf::ZIPS_COMPRESSION}) {
    const std::string name = compression == Imf::ZIP_COMPRESSION ? "zip" : "zips";
    compose::ExrMetadata metadata;
    metadata.compression = metadata.data_compression = name;
    std::vector<double> ours, theirs;
    std::size_t our_bytes = 0, their_bytes = 0;
    for (int turn = 0; turn < kTurns; ++turn) {
      ours.push_back(
          seconds_of([&] { our_bytes = compose::encode_exr(views, camera, metadata).size(); }));
      theirs.push_back(
          seconds_of([&] { their_bytes = openexr.write(compression, compression, 4); }));
    }
    fmt::print(
        "{} {}: {:.0f} ms, {:.2f} MB; OpenEXR {:.0f} ms, {:.2f} MB; {:.2f} times faster, "
        "{:+.1f} % of size\n",
        file, name, 1e3 * median(ours), 1e-6 * static_cast<double>(our_bytes), 1e3 * median(theirs),
        1e-6 * static_cast<double>(their_bytes), median(theirs) / median(ours),
        100.0 * static_cast<double>(our_bytes) / static_cast<double>(their_bytes) - 100);
  }
}

}  // namespace
}  // namespace raystage

int main(int argc, char** argv) {
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  for (int i = 1; i < argc; ++i) raystage::compare(argv[i]);
  return argc > 1 ? 0 : 2;
}
