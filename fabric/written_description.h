#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "fabric/mistakes.h"
#include "proto/weft/v1/fabric.pb.h"

namespace weft::fabric {

// A description as it was written: the message, what was wrong with the writing, and how to name
// the place of a field.
class WrittenDescription {
 public:
  WrittenDescription() = default;
  WrittenDescription(const WrittenDescription&) = delete;
  WrittenDescription& operator=(const WrittenDescription&) = delete;
  WrittenDescription(WrittenDescription&&) = delete;
  WrittenDescription& operator=(WrittenDescription&&) = delete;
  virtual ~WrittenDescription() = default;

  [[nodiscard]] const v1::FabricDescription& message() const { return message_; }

  // True when nothing of the message can be relied on: mistakes of meaning are not worth listing.
  [[nodiscard]] bool unreadable() const { return unreadable_; }

  // All mistakes, those of writing and `further` ones, one per line in the order of the file, each
  // with its place. Empty when there are none.
  [[nodiscard]] virtual std::string listing(const Mistakes& further) const = 0;

 protected:
  v1::FabricDescription message_;
  bool unreadable_ = false;
};

// Protobuf text format: places are "name:line:column". Unknown fields are mistakes and are skipped.
[[nodiscard]] std::unique_ptr<WrittenDescription> read_text(std::string_view text,
                                                            const std::string& name);

// JSON: places are "name: field.path", or "name:line:column" where the text is no JSON at all.
// Unknown fields and values of the wrong kind are mistakes and are skipped.
[[nodiscard]] std::unique_ptr<WrittenDescription> read_json(std::string_view text,
                                                            const std::string& name);

}  // namespace weft::fabric
