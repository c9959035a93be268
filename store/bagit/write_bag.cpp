// SPDX-License-Identifier: Apache-2.0
#include "store/bagit/write_bag.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <fstream>
#include <map>
#include <memory>
#include <new>
#include <system_error>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/posix_file.h"
#include "base/temporary_folder.h"
#include "store/bagit/digests.h"
#include "store/bagit/file_formats.h"
#include "store/bagit/ocfl_object.h"
#include "store/bagit/premis.h"
#include "store/fixity/event_log.h"
#include "store/fixity/manifest.h"
#include "store/fixity/verify.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;

constexpr std::array kBagDigests{DigestAlgorithm::kSha256, DigestAlgorithm::kSha512};
constexpr const char* kBagDisk = "Check the folder, its permissions and the free space on the disk";

/// A file of the bag with its digests.
struct BaggedFile {
  std::string path;  ///< relative to the bag
  std::uint64_t bytes = 0;
  std::string sha256, sha512;  ///< the latter empty without OCFL
  std::uint64_t xxh3 = 0;
};

/// Throws Error (bad input) if there is a file or folder of this name.
fs::path require_no_bag(const fs::path& given) {
  fs::path folder = path_with_name(given);
  if (!is_name_taken(folder)) return folder;
  throw Error::bad_input("a file or folder of this name exists", folder.string(),
                         "Choose another name for the bag, or remove it");
}

struct FreeXxh3 {
  void operator()(XXH3_state_t* state) const { XXH3_freeState(state); }
};

/// Percent-encodes what a URI's path cannot hold (RFC 3986).
std::string uri_part(std::string_view text) {
  std::string part;
  for (const char c : text) {
    const bool is_plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                          (c >= '0' && c <= '9') ||
                          std::string_view("-._~").find(c) != std::string_view::npos;
    part += is_plain ? std::string(1, c) : fmt::format("%{:02X}", static_cast<unsigned char>(c));
  }
  return part;
}

std::string bag_size_text(std::uint64_t bytes) {
  constexpr double kStep = 1000;
  double size = static_cast<double>(bytes);
  for (const char* unit : {"B", "kB", "MB", "GB", "TB"}) {
    if (size < kStep) return fmt::format("{:.{}f} {}", size, *unit == 'B' ? 0 : 1, unit);
    size /= kStep;
  }
  return fmt::format("{:.1f} PB", size);
}

class BagWriter {
 public:
  BagWriter(const Take& take, const fs::path& folder, const BagOptions& options)
      : take_(take),
        options_(options),
        working_(require_no_bag(folder)),
        root_(options.is_ocfl ? working_.path() / kOcflContent : working_.path()) {}

  BagWriteReport run() {
    report_.identifier = options_.identifier.empty() ? take_identifier(take_) : options_.identifier;
    copy_payload();
    verify_payload();
    add_creation_event();
    write_tag_files();
    if (options_.is_ocfl) write_object();
    require_not_stopped();
    if (!working_.commit()) {
      throw Error::from_errno("the bag cannot be renamed to its name", working_.target().string(),
                              "Choose another name for the bag");
    }
    report_.status = RunStatus::kFinished;
    return std::move(report_);
  }

 private:
  void require_not_stopped() const {
    if (!options_.stop.stop_requested()) return;
    throw Error::failed("writing the bag was stopped", working_.path().string(),
                        "Start it again; no files remain");
  }

  void copy_payload() {
    std::vector<std::string> paths = files_of_take(take_.folder());
    for (const char* name : {kManifestFile, kSignatureFile, kEventLogFile}) {
      std::error_code error;
      const fs::file_status status = fs::symlink_status(take_.folder() / name, error);
      if (fs::is_regular_file(status)) {
        paths.emplace_back(name);
      } else if (fs::exists(status)) {
        throw Error::bad_input("this is a link or a special file, which no bag can hold",
                               (take_.folder() / name).string(),
                               "Replace it by the file itself, or remove it");
      }
    }
    std::ranges::sort(paths);
    std::uintmax_t total = 0;
    for (const std::string& path : paths) {
      create_folder((root_ / "data" / path).parent_path());
      std::error_code error;
      const std::uintmax_t size = fs::file_size(take_.folder() / path, error);
      if (!error) total += size;
    }
    payload_.resize(paths.size());
    std::atomic<std::uintmax_t> done = 0;
    tbb::parallel_for(std::size_t{0}, paths.size(), [&](std::size_t i) {
      if (options_.stop.stop_requested()) return;
      payload_[i] = copy_file(paths[i], [&](std::size_t bytes) {
        const std::uintmax_t now = done += bytes;
        report_progress(static_cast<double>(now) / static_cast<double>(std::max(total, now)) / 2);
      });
    });
    require_not_stopped();
    report_.files = payload_.size();
    for (const BaggedFile& file : payload_) report_.bytes += file.bytes;
  }

  void report_progress(double done) const {
    if (options_.progress) options_.progress(done);
  }

  std::span<const DigestAlgorithm> algorithms() const {
    return std::span(kBagDigests).first(options_.is_ocfl ? 2 : 1);
  }

  template <class OnBytes>
  BaggedFile copy_file(const std::string& path, const OnBytes& on_bytes) const {
    BaggedFile copy;
    copy.path = "data/" + path;
    const std::unique_ptr<XXH3_state_t, FreeXxh3> xxh3(XXH3_createState());
    if (!xxh3 || XXH3_64bits_reset(xxh3.get()) != XXH_OK) throw std::bad_alloc();
    Digests digests(algorithms());
    OutputFile target(root_ / copy.path);
    read_in_parts({take_.folder(), path}, [&](std::span<const std::byte> part) {
      digests.update(part);
      XXH3_64bits_update(xxh3.get(), part.data(), part.size());
      if (!target.write_at(copy.bytes, part)) {
        throw Error::from_errno("the file cannot be written", target.path().string(), kBagDisk);
      }
      copy.bytes += part.size();
      on_bytes(part.size());
      return !options_.stop.stop_requested();
    });
    set_digests(copy, digests);
    copy.xxh3 = XXH3_64bits_digest(xxh3.get());
    return copy;
  }

  static void set_digests(BaggedFile& file, Digests& digests) {
    std::vector<std::string> hex = digests.hex();
    file.sha256 = std::move(hex[0]);
    if (hex.size() > 1) file.sha512 = std::move(hex[1]);
  }

  /// Verifies the copy, which finds damage of the take, too.
  void verify_payload() {
    TakeVerifyOptions how;
    how.progress = [&](double done) { report_progress(0.5 + done / 2); };
    how.stop = options_.stop;
    const TakeFixityReport found = verify_take(root_ / "data", how);
    require_not_stopped();
    schemas::TakeEvent event = new_event();
    event.type = "fixity check";
    event.detail = "bag: the copy of every frame and imported depth map compared with its XXH3";
    if (found.is_readable() && found.is_intact()) {
      require_manifest_fits();
      event.note = "intact";
      report_.events.push_back(make_event(take_.folder(), event));
      return;
    }
    event.outcome = schemas::TakeEvent::Outcome::kFailure;
    event.note = "damaged or not closed";
    if (options_.on_damage) options_.on_damage(make_event(take_.folder(), event));
    throw Error::bad_input("the take is damaged or not closed, and no bag was written",
                           take_.folder().string(),
                           "See what is wrong by `raystage verify`, and run `raystage repair`, or "
                           "restore the files from a copy");
  }

  /// Throws Error (bad input) if the take has a manifest of other files than the copied ones.
  void require_manifest_fits() const {
    const auto has_path = [](const std::string& path) {
      return [path](const BaggedFile& file) { return file.path == path; };
    };
    if (std::ranges::none_of(payload_, has_path(std::string("data/") + kManifestFile))) return;
    std::map<std::string, std::string> copied;  // SHA-256 of each path
    for (const BaggedFile& file : payload_) copied[file.path] = file.sha256;
    for (const char* name : {kManifestFile, kSignatureFile, kEventLogFile}) {
      copied.erase(std::string("data/") + name);
    }
    const Manifest manifest = parse_manifest(read_manifest(root_ / "data"), kManifestFile);
    std::string different;
    for (const Manifest::File& file : manifest.files) {
      const auto found = copied.find("data/" + file.path);
      if (found == copied.end() || found->second != file.sha256) different = file.path;
      if (found != copied.end()) copied.erase(found);
    }
    if (different.empty() && !copied.empty()) {
      different = fs::path(copied.begin()->first).lexically_relative("data").string();
    }
    if (different.empty()) return;
    throw Error::bad_input("the take is not as its manifest states, for example " + different,
                           (take_.folder() / kManifestFile).string(),
                           "See all differences by `raystage verify --manifest check`. If they are "
                           "meant, write the manifest anew");
  }

  schemas::TakeEvent new_event() const {
    schemas::TakeEvent event;
    event.program = options_.program;
    event.version = options_.version;
    return event;
  }

  void add_creation_event() {
    schemas::TakeEvent event = new_event();
    event.type = "information package creation";
    event.detail =
        options_.is_ocfl ? "bag --ocfl: BagIt 1.0 in an OCFL 1.1 object" : "bag: BagIt 1.0";
    event.note = fmt::format("{} files, {} bytes, identifier {}", report_.files, report_.bytes,
                             report_.identifier);
    report_.events.push_back(make_event(take_.folder(), event));
  }

  void add_tag_file(const std::string& path, std::string_view text) {
    create_folder((root_ / path).parent_path());
    write_file_atomically(root_ / path, text);
    add_written_tag_file(path);
  }
  void add_written_tag_file(const std::string& path) {
    BaggedFile file;
    file.path = path;
    Digests digests(algorithms());
    read_in_parts({root_, path}, [&](std::span<const std::byte> part) {
      digests.update(part);
      file.bytes += part.size();
      return true;
    });
    set_digests(file, digests);
    tags_.push_back(std::move(file));
  }

  void write_tag_files() {
    add_tag_file("bagit.txt", "BagIt-Version: 1.0\nTag-File-Character-Encoding: UTF-8\n");
    add_tag_file("bag-info.txt", bag_info());
    add_tag_file("manifest-sha256.txt", manifest_of(payload_));
    add_tag_file("premis.xml", premis());
    add_tag_file("xxh3/files.txt", xxh3_of_files());
    write_xxh3_of_frames();
    add_tag_file("representation/formats.csv", file_formats_as_csv());
    for (const std::string& path :
         copy_representation(options_.representation, root_ / "representation")) {
      add_written_tag_file("representation/" + path);
    }
    std::ranges::sort(tags_, {}, &BaggedFile::path);
    add_tag_file("tagmanifest-sha256.txt", manifest_of(tags_));
    report_.tag_files = tags_.size();
  }

  static std::string manifest_of(const std::vector<BaggedFile>& files) {
    std::string text;
    for (const BaggedFile& file : files) {
      text += fmt::format("{}  {}\n", file.sha256, encode_bag_path(file.path));
    }
    return text;
  }

  std::string bag_info() const {
    std::string text = fmt::format(
        "Bagging-Date: {}\nBag-Software-Agent: {} {}\nExternal-Identifier: {}\n"
        "External-Description: Raystage light field take of {} cameras\n"
        "Bag-Size: {}\nPayload-Oxum: {}.{}\n",
        format_utc(report_.events.back().time_utc).substr(0, 10), options_.program,
        options_.version, report_.identifier, take_.camera_count(), bag_size_text(report_.bytes),
        report_.bytes, report_.files);
    for (const BagInfo::Element& element : options_.info) {
      text += fmt::format("{}: {}\n", element.label, element.value);
    }
    return text;
  }

  std::string premis() {
    // Those of the log that is in the bag.
    EventLog log = read_event_log(root_ / "data");
    report_.damaged_log_lines = log.damaged_lines;
    log.events.insert(log.events.end(), report_.events.begin(), report_.events.end());
    std::vector<PremisFile> files;
    for (const BaggedFile& file : payload_) {
      files.push_back(
          {file.path.substr(std::string_view("data/").size()), file.path, file.bytes, file.sha256});
    }
    return premis_as_xml(report_.identifier, take_.document().name, files, log.events);
  }

  std::string xxh3_of_files() const {
    std::string text;
    for (const BaggedFile& file : payload_) {
      text += fmt::format("XXH3_{:016x}  {}\n", file.xxh3, file.path);
    }
    return text;
  }

  /// One line for each record, written camera by camera: there may be millions.
  void write_xxh3_of_frames() {
    const std::string path = "xxh3/frames.csv";
    create_folder((root_ / path).parent_path());
    OutputFile target(root_ / path);
    std::uint64_t offset = 0;
    const auto write = [&](const std::string& text) {
      if (!target.write_at(offset, std::as_bytes(std::span(text)))) {
        throw Error::from_errno("the file cannot be written", target.path().string(), kBagDisk);
      }
      offset += text.size();
    };
    write("archive,time_ns,offset,bytes,xxh3\r\n");
    const Take copy(root_ / "data");
    for (int camera = 0; camera < copy.camera_count(); ++camera) {
      const std::string archive =
          csv_field("data/" + copy.document().cameras[static_cast<std::size_t>(camera)].archive);
      std::string text;
      for (const FrameRecord& record : copy.archive(camera).records()) {
        if (record.status != FrameStatus::kStored) continue;
        text += fmt::format("{},{},{},{},{:016x}\r\n", archive, record.time_ns, record.offset,
                            record.size, record.xxh3);
      }
      write(text);
    }
    add_written_tag_file(path);
  }

  void write_object() const {
    std::vector<OcflFile> files;
    for (const auto* list : {&payload_, &tags_}) {
      for (const BaggedFile& file : *list) files.push_back({file.path, file.sha512, file.sha256});
    }
    std::ranges::sort(files, {}, &OcflFile::path);
    OcflVersion version;
    version.id = report_.identifier;
    version.created_utc = format_utc(report_.events.back().time_utc);
    version.message = "Take as a bag (BagIt 1.0)";
    version.user = options_.program + " " + options_.version;
    version.user_address = "urn:uuid:" + report_.events.back().id;
    write_ocfl_object(working_.path(), version, files);
  }

  const Take& take_;
  const BagOptions& options_;
  TemporaryFolder working_;
  const fs::path root_;
  std::vector<BaggedFile> payload_, tags_;
  BagWriteReport report_;
};

/// Returns what tells a copy of a take in another form from the recorded one: both may lie in one
/// OCFL storage root.
std::string_view query_of_form(const Take& take) {
  switch (take.archive(0).description().codec) {
    case FrameCodec::kJpeg:
    case FrameCodec::kPicture:
      return "";
    case FrameCodec::kPacked:
      return "?form=jpegxl";
    case FrameCodec::kHevc:
    case FrameCodec::kHevcCameras:
      return "?form=hevc";
    case FrameCodec::kAv1:
    case FrameCodec::kAv1Cameras:
      return "?form=av1";
  }
  return "";
}

}  // namespace

std::string take_identifier(const Take& take) {
  return fmt::format("x-raystage-take:{}/{}{}", uri_part(take.document().name),
                     format_utc(take.document().epoch_utc), query_of_form(take));
}

void check_bag_info(const std::vector<BagInfo::Element>& elements) {
  constexpr std::string_view kOwn[] = {
      "Bagging-Date",         "Bag-Software-Agent", "External-Identifier",
      "External-Description", "Bag-Size",           "Payload-Oxum"};
  const auto has_controls = [](std::string_view text) {
    return std::ranges::any_of(text, [](unsigned char c) { return c < ' ' || c == 0x7f; });
  };
  for (const BagInfo::Element& element : elements) {
    const std::string& label = element.label;
    const bool is_label = !label.empty() && label.find(':') == std::string::npos &&
                          label.front() != ' ' && label.back() != ' ' && !has_controls(label);
    TagFileFindings findings;
    if (!is_label || has_controls(element.value) ||
        !utf8_of_tag_file(label + element.value, "UTF-8", findings)) {
      throw Error::bad_input(
          fmt::format("\"{}: {}\" cannot be written to bag-info.txt", label, element.value), "",
          "Give a label without a colon and a value on one line, in UTF-8");
    }
    if (std::ranges::find(kOwn, label) != std::end(kOwn)) {
      throw Error::bad_input(fmt::format("bag-info.txt states {} by itself", label), "",
                             "Omit it, or give the identifier as such");
    }
  }
}

namespace {

/// Throws Error (bad input) if `text` does not have the form of a URI (RFC 3986): a scheme, a
/// colon, and text without blanks.
void check_identifier(std::string_view text) {
  const auto is_letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); };
  const auto is_of_scheme = [&](char c) {
    return is_letter(c) || (c >= '0' && c <= '9') || c == '+' || c == '-' || c == '.';
  };
  const std::size_t colon = text.find(':');
  const bool has_scheme = colon != std::string_view::npos && is_letter(text.front()) &&
                          std::ranges::all_of(text.substr(0, colon), is_of_scheme);
  if (has_scheme && colon + 1 < text.size() && text.find(' ') == std::string_view::npos) return;
  throw Error::bad_input(fmt::format("the identifier \"{}\" is no URI", text), "",
                         "Write for example urn:uuid:..., ark:/12345/x or https://...")
      .concerning({"identifier"});
}

}  // namespace

BagWriteReport write_bag(const Take& take, const fs::path& folder, const BagOptions& options) {
  take.check_not_inside(folder);
  check_bag_info(options.info);
  if (!options.identifier.empty()) {
    check_bag_info({{"Identifier", options.identifier}});
    check_identifier(options.identifier);
  }
  return BagWriter(take, folder, options).run();
}

}  // namespace raystage::store
