// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/message_stream.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>

#include "dkb/dataset/folder_layouts.h"
#include "dkb/recordings/bag_stream.h"
#include "dkb/recordings/mcap_stream.h"
#include "dkb/recordings/recorded_topics.h"
#include "dkb/recordings/recording_file.h"
#include "dkb/recordings/sqlite_stream.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"

namespace dkb {
namespace {

namespace fs = std::filesystem;

std::unique_ptr<MessageStream> open_file(const fs::path& path) {
  auto file = std::make_unique<RecordingFile>(path);
  if (file->size() == 0) throw InputError(file->name() + ": is empty");
  if (BagStream::fits(*file)) return std::make_unique<BagStream>(std::move(file));
  if (McapStream::fits(*file)) return std::make_unique<McapStream>(std::move(file));
  const std::string begin(file->peek(0, 16));
  if (begin == std::string_view("SQLite format 3\0", 16)) return open_sqlite_messages(path);
  if (begin.rfind("\x28\xB5\x2F\xFD", 0) == 0)
    throw InputError(file->name() + ": is compressed as a whole; `zstd -d` on it gives a recording that can be read");
  throw InputError(file->name() +
                   ": is no recording of a known kind (.bag of ROS 1, .mcap, .db3 of rosbag2); its "
                   "content tells the kind, not its name; of images in a folder give the folder");
}

bool is_recording(const fs::path& path) {
  return path.extension() == ".db3" || path.extension() == ".mcap";
}

// The files of a rosbag2 folder in their order.
std::vector<fs::path> files_of(const fs::path& folder) {
  std::vector<fs::path> files;
  const fs::path list = folder / "metadata.yaml";
  std::error_code error;
  if (!fs::exists(list, error)) {  // its recorder was stopped before it could write one
    for (const fs::directory_entry& entry : fs::directory_iterator(folder, error))
      if (is_recording(entry.path())) files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    if (files.empty())
      throw InputError(folder.string() +
                       ": is no folder of rosbag2: it has no metadata.yaml, no .db3 and no .mcap file; "
                       "`dkb-slam record` brings images in other layouts into TUM's");
    return files;
  }
  std::string mode;
  try {
    const YAML::Node info = YAML::Load(read_file(list))["rosbag2_bagfile_information"];
    mode = info["compression_mode"].as<std::string>("");
    for (const YAML::Node& name : info["relative_file_paths"]) {
      // Older ones are relative to the folder above.
      const fs::path path = name.as<std::string>();
      const bool below = path.is_relative() && std::find(path.begin(), path.end(), "..") == path.end();
      files.push_back(below && fs::exists(folder / path, error) ? folder / path : folder / path.filename());
    }
  } catch (const YAML::Exception& e) {
    throw InputError(list.string() + ": cannot be understood (" + e.what() + ")");
  }
  if (files.empty()) throw InputError(list.string() + ": names no files (relative_file_paths)");
  for (const fs::path& file : files)
    if (file.extension() == ".zstd")
      throw InputError(file.string() +
                       ": is compressed as a whole; `ros2 bag convert`, or `zstd -d` on it and its new name "
                       "in metadata.yaml, give a recording that can be read");
  std::transform(mode.begin(), mode.end(), mode.begin(), [](unsigned char c) { return std::tolower(c); });
  if (mode == "message")
    throw InputError(folder.string() +
                     ": each of its messages is compressed by itself, which is not read; `ros2 bag "
                     "convert` writes it anew");
  return files;
}

// Several files, one after the other.
class JoinedStream final : public MessageStream {
 public:
  explicit JoinedStream(std::vector<fs::path> files) : files_(std::move(files)) {
    for (size_t i = 0; i < files_.size(); ++i) {
      open(i);
      std::vector<RecordedTopic> topics = file_->topics();
      for (size_t t = 0; t < topics.size(); ++t)
        if (topics[t].count && topic_of_[t]) topics_.add_count(*topic_of_[t], *topics[t].count);
      texts_.merge(file_->metadata());
    }
    if (files_.size() > 1) open(0);
  }

  const std::vector<RecordedTopic>& topics() const override { return topics_.all(); }
  void select(const std::vector<std::string>& names) override {
    topics_.select(names);
    selected_ = names;
    file_->select(names);
  }
  std::optional<RecordedMessage> next() override {
    while (true) {
      if (std::optional<RecordedMessage> message = file_->next()) {
        map_topics();
        if (!topic_of_[message->topic]) continue;
        message->topic = *topic_of_[message->topic];
        return message;
      }
      take_from_file();
      if (index_ + 1 >= files_.size()) return std::nullopt;
      open(index_ + 1);
    }
  }
  void rewind() override { files_.size() > 1 ? open(0) : file_->rewind(); }
  std::map<std::string, std::string> metadata() const override { return texts_; }
  std::vector<std::string> take_warnings() override {
    take_from_file();
    return warnings_.take();
  }

 private:
  void open(size_t index) {
    file_ = open_file(files_[index]);
    index_ = index;
    if (selected_) file_->select(*selected_);
    topic_of_.clear();
    map_topics();
  }
  void map_topics() {
    const std::vector<RecordedTopic>& topics = file_->topics();
    for (size_t t = topic_of_.size(); t < topics.size(); ++t)
      topic_of_.push_back(topics_.add(topics[t].name, topics[t].type, topics[t].encoding));
  }
  void take_from_file() {
    for (std::string& line : file_->take_warnings()) warnings_.add(std::move(line));
  }

  const std::vector<fs::path> files_;
  size_t index_ = 0;
  std::unique_ptr<MessageStream> file_;
  RecordedTopics topics_;
  std::vector<std::optional<size_t>> topic_of_;  // by the file's
  std::optional<std::vector<std::string>> selected_;
  std::map<std::string, std::string> texts_;
  RecordingWarnings warnings_;
};

}  // namespace

bool is_rosbag2(const fs::path& folder) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) return false;
  bool holds_files = fs::exists(folder / "metadata.yaml", error);
  for (fs::directory_iterator it(folder, error), end; !holds_files && !error && it != end; it.increment(error))
    holds_files = is_recording(it->path());
  return holds_files && !has_folder_layout(folder);
}

std::unique_ptr<MessageStream> open_messages(const fs::path& path) {
  std::error_code error;
  if (!fs::exists(path, error)) throw InputError(path.string() + ": no such file or folder");
  if (fs::is_directory(path, error)) return std::make_unique<JoinedStream>(files_of(path));
  return open_file(path);
}

}  // namespace dkb
