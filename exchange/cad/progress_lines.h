#pragma once

#include <opencascade/Message_ProgressIndicator.hxx>
#include <string>

namespace limn::cad {

/// Writes lines "progress PERCENT WHAT" for the program that started this one, each when the percentage has
/// grown. A stage covers a part of the whole.
class ProgressLines : public Message_ProgressIndicator {
 public:
  /// Writes to this file descriptor; -1: nothing.
  explicit ProgressLines(int descriptor) : descriptor_(descriptor) {}

  /// Begins a stage that goes from one percentage to another.
  void begin_stage(const std::string& what, double from, double to);
  /// The share of the stage that is done, from 0 to 1.
  void advance(double share);

 protected:
  void Show(const Message_ProgressScope& scope, Standard_Boolean is_forced) override;

 private:
  int descriptor_, printed_ = -1;
  std::string what_;
  double from_ = 0, to_ = 100;
};

}  // namespace limn::cad
