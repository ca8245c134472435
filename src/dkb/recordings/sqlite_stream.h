// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>

#include "dkb/recordings/message_stream.h"

namespace dkb {

// A .db3 file of rosbag2, in the order of its time stamps. Throws InputError, also where SQLite was not built in.
std::unique_ptr<MessageStream> open_sqlite_messages(const std::filesystem::path& path);

}  // namespace dkb
