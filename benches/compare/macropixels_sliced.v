// The macropixels of the array as cycle-accurate RTL, bit-sliced for Verilator's speed: a register bit of WIDTH macropixels
// is one word, so that an operation does all of them. One evaluation per CLK period; the shift register stands still
// while its place of the newest bit moves; counters at rest are passed over and carries end where no macropixel has one.
// TYPE is "greater" and THRESHOLD 0, as in the stimulus: a population count would cost it more. STOP rises with a falling
// CLK edge and the strobe precedes the next rising one, as at 384 MHz.
module macropixels #(parameter PIXELS = 4096, WIDTH = 64, WORDS = PIXELS / WIDTH) (
    input clk,            // once per CLK period: its falling edge, then its rising one
    input stop,           // a STOP edge comes with this falling edge
    input [1:0] kind,     // TYPE and
    input [4:0] threshold // THRESHOLD, for the harness alone
);
    reg [WIDTH-1:0] start [0:WORDS*9-1]     /* verilator public */; // by word and bit
    reg [WIDTH-1:0] raw   [0:WORDS*16-1]    /* verilator public */; // by word and SPAD: pulsed before this rising edge
    reg [WIDTH-1:0] count [0:WORDS*16*14-1] /* verilator public */; // by word, bin and bit
    reg [WIDTH-1:0] value [0:WORDS*9-1];
    reg [WIDTH-1:0] shift [0:WORDS*16-1];
    reg [WIDTH-1:0] running [0:WORDS-1];
    reg [WIDTH-1:0] timed   [0:WORDS-1];
    reg [3:0]       newest;
    reg [WIDTH-1:0] carry, old, local_stop;

    integer i, b, w;
    initial begin
        for (i = 0; i < WORDS * 16; i = i + 1) begin raw[i] = 0; shift[i] = 0; end
        for (i = 0; i < WORDS * 9; i = i + 1) value[i] = 0;
        for (i = 0; i < WORDS * 16 * 14; i = i + 1) count[i] = 0;
        for (i = 0; i < WORDS; i = i + 1) begin running[i] = 0; timed[i] = 0; end
        newest = 0;
    end

    always @(posedge clk) begin
        newest = newest + 1;
        for (w = 0; w < WORDS; w = w + 1) begin
            if (stop) begin
                for (b = 0; b < 9; b = b + 1) value[w * 9 + b] = start[w * 9 + b];
                running[w] = {WIDTH{1'b1}};
            end else if (running[w] != 0) begin
                carry = running[w]; // of the decrement: a borrow
                for (b = 0; b < 9; b = b + 1) begin
                    old = value[w * 9 + b];
                    value[w * 9 + b] = old ^ carry;
                    carry = carry & ~old;
                end
                if (carry != 0) begin
                    running[w] = running[w] & ~carry;
                    local_stop = carry;
                    for (i = 0; i < 16; i = i + 1) begin
                        carry = local_stop & shift[w * 16 + ((newest + i) & 15)]; // from the oldest
                        b = 0;
                        while (b < 14 && carry != 0) begin
                            old = count[(w * 16 + i) * 14 + b];
                            count[(w * 16 + i) * 14 + b] = old ^ carry;
                            carry = carry & old;
                            b = b + 1;
                        end
                        if (carry != 0) // overflow: back to the largest count
                            for (b = 0; b < 14; b = b + 1)
                                count[(w * 16 + i) * 14 + b] = count[(w * 16 + i) * 14 + b] | carry;
                    end
                end
            end
            shift[w * 16 + newest] = timed[w];
            old = 0;
            for (i = 0; i < 16; i = i + 1) begin
                old = old | raw[w * 16 + i];
                raw[w * 16 + i] = 0;
            end
            timed[w] = old;
        end
    end
endmodule
