// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

namespace dkb {

// Keeps a folder to one writer: an advisory lock on the folder itself. It leaves no file behind and ends with the
// process, however that ends. Where the file system knows no locks, it holds nobody off.
class FolderLock {
 public:
  // Throws InputError when another one holds it.
  explicit FolderLock(const std::filesystem::path& folder);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int fd_;
};

}  // namespace dkb
