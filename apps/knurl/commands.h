/* commands.h: one function per command; each gets its own arguments, argv[0] being "knurl COMMAND", and
 * returns the program's exit status. */
#ifndef APP_COMMANDS_H
#define APP_COMMANDS_H

int render_command(int argc, char **argv);
int trace_command(int argc, char **argv);
int info_command(int argc, char **argv);
int compare_command(int argc, char **argv);
int bake_command(int argc, char **argv);
int bench_command(int argc, char **argv);
int capture_command(int argc, char **argv);

#endif
