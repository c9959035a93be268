// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "base/time.h"

namespace raystage::schemas {

/// Schema "raystage/record/1": what one ingest node records, and how.
struct RecordConfig {
  /// Any input that FFmpeg can open.
  struct FfmpegSource {
    std::string url;  ///< a URL, file or device, or "pipe:0"; "v4l2:/dev/video0" names the format
    std::string format = {};  ///< FFmpeg's input format; empty: detected from the URL
    std::map<std::string, std::string> options =
        {};                                   ///< FFmpeg's options, e.g. "video_size": "640x480"
    bool realtime = false;                    ///< deliver a file at its frame rate, like a camera
    std::optional<double> max_frame_mb = {};  ///< larger frames are dropped, MB = 10^6 bytes
  };
  /// A GigE Vision or USB3 Vision camera.
  struct AravisSource {
    std::string device;  ///< Aravis's ID or serial number; empty: the first device found
    std::optional<double> exposure_us;  ///< microseconds
    std::optional<double> gain;         ///< in the device's unit, mostly dB
    std::optional<double> fps;
    std::string trigger;             ///< the device's trigger source; empty: free running
    std::string pixel_format;        ///< GenICam's name, e.g. "Mono8"; empty: the device's setting
    std::optional<int> packet_size;  ///< bytes
    int buffers = 16;
    bool packet_resend = true;
    bool packet_socket = true;  ///< raw socket: faster, but not over loopback
    int socket_buffer_bytes = 4 << 20;
  };
  /// Camera `index` of the simulated array, in real time.
  struct SimulatedSource {
    std::string scene = "stage";
    std::uint64_t seed = 1;
    int rows = 8, columns = 8, index = 0;
    int width = 320, height = 240;
    double fps = 15;
    double seconds = 3.8;  ///< of the scene, rendered in advance, played forwards and backwards
    bool jpeg = false;     ///< deliver JPEG like a webcam, not raw pixels
  };
  using Source = std::variant<FfmpegSource, AravisSource, SimulatedSource>;

  struct Camera {
    std::string id;
    Source source;
  };
  enum class OverflowPolicy { kDropNewest, kDropOldest };
  enum class LostSourcePolicy { kContinue, kReconnect, kStop };
  enum class Chroma { k444, k422, k420 };

  std::string name;
  std::string node;        ///< name of this ingest node; empty: the host name
  std::string rig;         ///< path of rig.json, relative to this file; empty: uncalibrated
  std::string mirror;      ///< folder for a second copy, relative to this file; empty: none
  double nominal_fps = 0;  ///< 0: as the sources report
  std::string color_space = "srgb_texture";
  double memory_mb = 1024;                       ///< for all frames of all cameras, 10^6 bytes
  std::optional<double> memory_ceiling_mb = {};  ///< of the whole process, 10^6 bytes
  bool hold = false;                             ///< keep everything in memory until the end
  OverflowPolicy when_full = OverflowPolicy::kDropNewest;
  LostSourcePolicy when_lost = LostSourcePolicy::kContinue;
  double lost_after_seconds = 5;  ///< time without a frame after which a source is lost
  int quality = 90;               ///< JPEG quality of encoded raw frames, libjpeg's scale
  Chroma chroma = Chroma::k420;
  int restart_interval = -1;  ///< MCUs; -1: the default, 0: none
  std::vector<Camera> cameras;
};

/// Reads the document. Throws Error (bad input) at "FILE#/json/pointer" with the value found and
/// what is allowed.
RecordConfig read_record_config(const std::filesystem::path& file);
/// Parses and formats the document in memory; errors use `name` as the file name.
RecordConfig parse_record_config(std::string_view text, std::string_view name);
std::string format_record_config(const RecordConfig& config);

}  // namespace raystage::schemas
